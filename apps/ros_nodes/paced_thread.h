#pragma once
// A thread that does the same again and again, at a fifth of a processor at most.

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

namespace mapweave::ros_nodes {

class PacedThread {
 public:
  // Between two turns lies the least pause, or four times what the turn took of a processor: it must not have others
  // work for it.
  PacedThread(std::function<void()> turn, std::chrono::milliseconds least_pause);
  ~PacedThread();  // after a turn that is on its way
  PacedThread(const PacedThread&) = delete;
  PacedThread& operator=(const PacedThread&) = delete;

 private:
  void run();

  const std::function<void()> turn_;
  const std::chrono::milliseconds least_pause_;
  std::mutex mutex_;
  std::condition_variable changed_;
  bool ends_ = false;
  std::thread thread_;
};

}  // namespace mapweave::ros_nodes
