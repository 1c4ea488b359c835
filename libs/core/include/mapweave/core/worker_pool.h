#pragma once
// Threads for pure work. Results come back in the order of their numbers, whatever the number of threads, so folding
// them is deterministic.

#include <cstddef>
#include <functional>
#include <memory>
#include <optional>
#include <vector>

namespace mapweave {

class WorkerPool {
 public:
  // threads >= 1; 1 runs everything in the calling thread.
  explicit WorkerPool(int threads);
  ~WorkerPool();
  WorkerPool(const WorkerPool&) = delete;
  WorkerPool& operator=(const WorkerPool&) = delete;
  int threads() const;

  // Calls task(0) .. task(count - 1), each once, and returns when all are done. The calling thread works too, so calls
  // may nest. When tasks throw, the others still run and the exception of the lowest number is rethrown.
  void for_each(std::size_t count, const std::function<void(std::size_t)>& task);

  // The same, returning the results in the order of their numbers.
  template <class Function>
  auto map(std::size_t count, Function&& function) {
    using Result = decltype(function(std::size_t{}));
    std::vector<std::optional<Result>> slots(count);
    for_each(count, [&](std::size_t i) { slots[i].emplace(function(i)); });
    std::vector<Result> results;
    results.reserve(count);
    for (auto& slot : slots) results.push_back(std::move(*slot));
    return results;
  }

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// The processors this process may use (affinity and cgroup quota respected); at least 1.
int available_processors();

}  // namespace mapweave
