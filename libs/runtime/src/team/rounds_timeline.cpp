#include "wires.h"

#include <mapweave/runtime/run_configuration.h>

#include <algorithm>
#include <set>

namespace mapweave::runtime {
namespace {

// Rounds in virtual time. Robots' data flow while they drive; a tier that is busy when a round comes leaves it out, and
// takes what came with the next one.
class Rounds {
 public:
  Rounds(const TimelineOptions& options, const Work& work) : options_(options), work_(work), wires_(options) {}

  RoundsTimeline run() {
    for (const RoundWork& round : work_.rounds) add(round);
    for (auto& [tier, state] : states_) {
      if (state.shown_at_s) state.sum.most_age_s = std::max(state.sum.most_age_s, end_s() - *state.shown_at_s);
      state.sum.tier = tier;
      if (tier != cloud_tier()) result_.tiers.push_back(state.sum);
    }
    if (const auto cloud = states_.find(cloud_tier()); cloud != states_.end())
      result_.tiers.push_back(cloud->second.sum);
    return std::move(result_);
  }

 private:
  struct State {
    RoundsTimeline::Tier sum;
    double busy_until_s = 0.0;
    bool is_waiting = false;           // for the next round
    std::uint64_t waiting_bytes = 0;   // of an edge's rounds that were left out
    std::optional<double> shown_at_s;  // of data, of its preview
  };

  double end_s() const { return std::max(options_.recorded_s, work_.rounds.back().at_s); }
  std::string cloud() const { return options_.cloud.at.empty() ? cloud_tier().str() : options_.cloud.at; }
  double speed_of(const RoundWork::Fused& fused) const {
    if (fused.tier != cloud_tier()) return options_.processors.edge_speed() * fused.speed;
    if (options_.cloud.at.empty()) return options_.processors.cloud_speed();
    for (const EdgeWork& edge : work_.edges)
      if (edge.id.str() == options_.cloud.at) return options_.processors.edge_speed() * edge.speed;
    return options_.processors.edge_speed();
  }
  double send(const std::string& from, const std::string& to, const transport::LinkModelOptions& wire, double at_s,
              std::uint64_t bytes) {
    return from == to ? at_s : wires_.send(from, to, wire, at_s - options_.recorded_s, bytes) + options_.recorded_s;
  }

  // Of each tier, when all that it fuses in this round is there.
  std::map<TierId, double> arrivals(const RoundWork& round) {
    const NetworkOptions& network = options_.network;
    std::map<TierId, double> there_s;
    for (const RoundWork::Sent& sent : round.robots) {
      const bool is_alone = sent.to.empty();
      const auto& wire = is_alone && options_.cloud.at.empty() ? network.robot_cloud : network.robot_edge;
      double& there = there_s.emplace(is_alone ? cloud_tier() : sent.to, round.at_s).first->second;
      there = std::max(there, send(sent.robot.str(), is_alone ? cloud() : sent.to.str(), wire, round.at_s, sent.bytes));
    }
    return there_s;
  }

  void add(const RoundWork& round) {
    std::map<TierId, double> there_s = arrivals(round);
    std::vector<RoundsTimeline::Ready> line;
    std::set<TierId> fused_now;
    for (const RoundWork::Fused& fused : round.fused) {
      if (fused.tier == cloud_tier() && there_s.count(fused.tier) == 0) {  // its edges were busy
        line.push_back({0.0, true});
        continue;
      }
      State& state = states_[fused.tier];
      fused_now.insert(fused.tier);
      state.sum.fusing_cpu_s += fused.fusing_s;
      state.sum.bytes += fused.bytes;
      const double begin_s = there_s.emplace(fused.tier, round.at_s).first->second;
      if (state.busy_until_s > begin_s) {
        ++state.sum.left_out;
        state.waiting_bytes += fused.bytes;
        state.is_waiting = true;
        line.push_back({0.0, true});
        continue;
      }
      line.push_back({fuse(round, fused, begin_s, state, there_s), false});
    }
    for (auto& [tier, state] : states_)  // to whom nothing came, whose preview shows all there is
      if (fused_now.count(tier) == 0 && state.shown_at_s && !state.is_waiting) state.shown_at_s = round.at_s;
    result_.rounds.push_back(std::move(line));
  }

  double fuse(const RoundWork& round, const RoundWork::Fused& fused, double begin_s, State& state,
              std::map<TierId, double>& there_s) {
    const double ready_s = begin_s + fused.fusing_s / speed_of(fused);
    ++state.sum.fused;
    state.busy_until_s = ready_s;
    state.sum.slowest_s = std::max(state.sum.slowest_s, ready_s - round.at_s);
    if (state.shown_at_s) state.sum.most_age_s = std::max(state.sum.most_age_s, ready_s - *state.shown_at_s);
    state.shown_at_s = round.at_s;
    state.is_waiting = false;
    const std::uint64_t bytes = fused.bytes + std::exchange(state.waiting_bytes, 0);
    if (fused.tier != cloud_tier() && bytes > 0) {
      double& there = there_s.emplace(cloud_tier(), round.at_s).first->second;
      there = std::max(there, send(fused.tier.str(), cloud(), options_.network.edge_cloud, ready_s, bytes));
    }
    if (!fused.joint.empty() && (!result_.first_joint || ready_s < result_.first_joint->ready_s))
      result_.first_joint = RoundsTimeline::Joint{fused.tier, fused.joint.front(), round.at_s, ready_s};
    return ready_s;
  }

  const TimelineOptions& options_;
  const Work& work_;
  Wires wires_;
  RoundsTimeline result_;
  std::map<TierId, State> states_;
};

}  // namespace

RoundsTimeline rounds_timeline(const TimelineOptions& options, const Work& work) {
  return work.rounds.empty() ? RoundsTimeline() : Rounds(options, work).run();
}

}  // namespace mapweave::runtime
