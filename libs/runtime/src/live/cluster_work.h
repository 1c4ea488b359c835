#pragma once
// Work that a run gives to workers, a task each.

#include "cluster_task.h"

#include <mapweave/core/progress.h>
#include <mapweave/runtime/cluster.h>

#include <memory>
#include <string>
#include <vector>

namespace mapweave::runtime {

class ClusterWork {
 public:
  virtual ~ClusterWork() = default;
  virtual std::string name() const = 0;  // for people: "robot alpha"
  virtual ClusterTask task() const = 0;
  // Of the worker that has it now. True: that was all. Throws Error for what is not sound, which costs the worker the
  // task.
  virtual bool take(const transport::Envelope& envelope, const std::string& where) = 0;
  // What came of it so far does not count: another worker begins again.
  virtual void begin_again() = 0;
  // No idle worker can do it, and why. True: it is done without them.
  virtual bool give_up(const Error&) { return false; }
};

// Work whose answer is one message.
class AnsweredWork : public ClusterWork {
 public:
  bool take(const transport::Envelope& envelope, const std::string& where) final;
  void begin_again() final { reader_ = {}; }
  bool give_up(const Error& why) final;

 private:
  virtual void take_answer(ClusterMessage answer, const std::string& where) = 0;
  ClusterReader reader_;
};

// All of it, each by whoever is idle. Waits for workers without end, and says so. `what`: for people, of all of it.
// Throws Interrupted, and Error where no idle worker can do what only they can do.
void run_on_cluster(const std::string& what, const std::vector<std::unique_ptr<ClusterWork>>& works,
                    const Cluster& cluster, Progress& progress);

// What a worker does, by the kind of its task. Throw Error for a task that is not sound, and Interrupted.
ClusterMessage judged_by_worker(const ClusterTask& task, Progress& progress);
// logs: of the task's robots, here.
ClusterMessage drawn_by_worker(const ClusterTask& task, const std::vector<std::filesystem::path>& logs,
                               Progress& progress);

}  // namespace mapweave::runtime
