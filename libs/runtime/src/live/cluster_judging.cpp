#include "cluster_run.h"
#include "cluster_work.h"

#include <mapweave/runtime/manifest.h>

namespace mapweave::runtime {
namespace {

class JudgingOnWorker final : public AnsweredWork {
 public:
  JudgingOnWorker(ClusterTask task, std::size_t of) : task_(std::move(task)), of_(of) {}
  std::string name() const override { return task_.name; }
  ClusterTask task() const override { return task_; }
  std::size_t of() const { return of_; }  // the number of the work that it is a part of
  const std::optional<std::vector<Judgement>>& judgements() const { return judgements_; }

 private:
  void take_answer(ClusterMessage answer, const std::string& where) override {
    if (answer.blobs.size() != 1) throw Error(ErrorCode::kCorrupt, "what it judged is not there", where);
    judgements_ = tiers::decode_judgements(answer.blobs.front(), where);
  }

  ClusterTask task_;
  std::size_t of_;
  std::optional<std::vector<Judgement>> judgements_;
};

std::vector<Judgement> judged(const ClusterTask& task, const fusion::FusionOptions& options, WorkerPool& pool,
                              Progress& progress) {
  const tiers::JudgingTask judging{task.blobs.front(), {task.blobs.begin() + 1, task.blobs.end()}};
  return tiers::judge(tiers::work_of(judging, "task"), options, nullptr, pool, progress);
}

}  // namespace

std::vector<std::vector<Judgement>> judge_on_cluster(const RunConfiguration& configuration,
                                                     const std::vector<tiers::JudgingWork>& judging,
                                                     const Cluster& cluster, WorkerPool& pool, Progress& progress) {
  std::vector<std::unique_ptr<ClusterWork>> works;
  std::vector<const JudgingOnWorker*> asked_for;
  const std::size_t workers = std::max<std::size_t>(1, cluster.idle_workers().size());
  const std::string text = to_yaml(configuration_of_task(configuration));
  for (std::size_t i = 0; i < judging.size(); ++i)
    for (tiers::JudgingTask& task : tiers::shared_out(judging[i], workers)) {
      ClusterTask asked;
      asked.version = program_version();
      asked.kind = ClusterTaskKind::judging;
      asked.name = "judging " + std::to_string(works.size() + 1);
      asked.configuration = text;
      asked.blobs = std::move(task.updates);
      asked.blobs.insert(asked.blobs.begin(), std::move(task.pairs));
      auto work = std::make_unique<JudgingOnWorker>(std::move(asked), i);
      asked_for.push_back(work.get());
      works.push_back(std::move(work));
    }
  if (!works.empty()) run_on_cluster("pairs of maps judged by workers", works, cluster, progress);
  std::vector<std::vector<Judgement>> judgements(judging.size());
  for (const JudgingOnWorker* work : asked_for) {
    std::vector<Judgement>& all = judgements[work->of()];
    const auto some =
        work->judgements() ? *work->judgements() : judged(work->task(), configuration.fusion, pool, progress);
    all.insert(all.end(), some.begin(), some.end());
  }
  return judgements;
}

ClusterMessage judged_by_worker(const ClusterTask& task, Progress& progress) {
  if (task.blobs.empty()) throw Error(ErrorCode::kCorrupt, "nothing is to be judged", "task");
  const WorkerPlan plan = configuration_in(task.configuration);
  WorkerPool pool(1);
  return {{}, {tiers::encode(judged(task, plan.configuration.fusion, pool, progress))}};
}

}  // namespace mapweave::runtime
