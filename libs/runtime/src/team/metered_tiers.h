#pragma once
// Edges and the cloud with what they cost: processor time of this process, and bytes that they send.

#include <mapweave/runtime/metrics.h>
#include <mapweave/runtime/timeline.h>
#include <mapweave/tiers/cloud_merger.h>
#include <mapweave/tiers/edge_server.h>

#include <numeric>
#include <utility>

namespace mapweave::runtime {

// What `call` returns; its processor time is added to `sum_s`.
template <class Call>
auto metered(double& sum_s, Call&& call) {
  struct Meter {
    double& sum_s;
    const double begin_s = process_cpu_seconds();
    ~Meter() { sum_s += process_cpu_seconds() - begin_s; }
  } const meter{sum_s};
  return call();
}

inline std::uint64_t bytes_of(const std::vector<std::string>& messages) {
  return std::accumulate(messages.begin(), messages.end(), std::uint64_t{0},
                         [](std::uint64_t sum, const std::string& message) { return sum + message.size(); });
}

class MeteredEdge {
 public:
  MeteredEdge(tiers::EdgeServer edge, double speed) : edge_(std::move(edge)) {
    work_.id = edge_.id();
    work_.speed = speed;
  }

  // `ended`: a RobotOutcome or RobotUpdates.
  template <class Ended>
  tiers::EdgeServer::Effects step(const Ended& ended, WorkerPool& pool, Progress& progress) {
    auto effects = metered(work_.fusing_s, [&] { return edge_.step(ended, pool, progress); });
    work_.bytes += bytes_of(effects.for_cloud) + bytes_of(effects.merged);
    work_.thinning = edge_.thinning();
    return effects;
  }
  tiers::EdgeServer::Effects whole_maps(const std::vector<MapId>& maps) {
    auto effects = metered(work_.fusing_s, [&] { return edge_.whole_maps(maps); });
    work_.bytes += bytes_of(effects.for_cloud);
    return effects;
  }
  tiers::EdgeServer::Effects step(const tiers::JudgingTask& task, WorkerPool& pool, Progress& progress) {
    auto effects = metered(work_.judging_s, [&] { return edge_.step(task, pool, progress); });
    work_.sent_bytes += bytes_of(task.updates);
    work_.judged_bytes += bytes_of(effects.for_cloud);
    return effects;
  }
  // The same where workers judged: their time is not this process's.
  tiers::EdgeServer::Effects step(const tiers::JudgingTask& task, const std::vector<Judgement>& judgements) {
    auto effects = metered(work_.judging_s, [&] { return edge_.step(judgements); });
    work_.sent_bytes += bytes_of(task.updates);
    work_.judged_bytes += bytes_of(effects.for_cloud);
    return effects;
  }
  const tiers::EdgeServer& edge() const { return edge_; }
  TierId id() const { return edge_.id(); }
  const fusion::FusionResult& result() const { return edge_.result(); }
  const EdgeWork& work() const { return work_; }

 private:
  tiers::EdgeServer edge_;
  EdgeWork work_;
};

class MeteredCloud {
 public:
  explicit MeteredCloud(tiers::CloudMerger cloud) : cloud_(std::move(cloud)) {}

  void set_priors(std::vector<fusion::MapPrior> priors) { cloud_.set_priors(std::move(priors)); }
  void set_refused(std::set<std::pair<MapId, MapId>> refused) { cloud_.set_refused(std::move(refused)); }
  void set_vetoed(std::set<Hash> vetoed) { cloud_.set_vetoed(std::move(vetoed)); }
  void begin_with(std::vector<Map> maps) { cloud_.begin_with(std::move(maps)); }
  void receive(const std::string& update, const std::string& where) {
    metered(fusing_s_, [&] { return cloud_.receive(update, where); });
  }
  void receive_merged(const std::string& merged, const std::string& where) {
    metered(fusing_s_, [&] { cloud_.receive_merged(merged, where); });
  }
  std::map<TierId, std::vector<MapId>> wanted_as_whole(const fusion::FusionResult& result) {
    return cloud_.wanted_as_whole(result);
  }
  bool is_newer_than_sealed() const { return cloud_.is_newer_than_sealed(); }
  std::vector<std::string> notes(const fusion::FusionResult& result) const { return cloud_.notes(result); }
  std::map<TierId, tiers::JudgingTask> judging_tasks(const std::set<TierId>& edges, WorkerPool& pool) {
    auto tasks = metered(fusing_s_, [&] { return cloud_.judging_tasks(edges, pool); });
    planning_s_ = fusing_s_;
    return tasks;
  }
  tiers::JudgingWork first_work(const std::set<TierId>& edges, WorkerPool& pool) const {
    return cloud_.first_work(edges, pool);
  }
  void know(const std::vector<Judgement>& judgements) { cloud_.know(judgements); }
  fusion::FusionResult seal(WorkerPool& pool, Progress& progress) {
    return metered(fusing_s_, [&] { return cloud_.seal(pool, progress); });
  }
  double fusing_s() const { return fusing_s_; }      // all of it
  double planning_s() const { return planning_s_; }  // of these, before it knew what edges shall judge

 private:
  tiers::CloudMerger cloud_;
  double fusing_s_ = 0.0, planning_s_ = 0.0;
};

}  // namespace mapweave::runtime
