#pragma once
// Fusion in rounds while robots drive (RecSLAM III-C): what a run counts of them, and when each preview would have been
// there, had each tier been a machine of its own. Never part of a sealed result.

#include <mapweave/core/ids.h>
#include <mapweave/core/options.h>
#include <mapweave/maps/judgement.h>

#include <nlohmann/json_fwd.hpp>

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <vector>

namespace mapweave::runtime {

struct RoundOptions {
  double period_s = 0.0, new_area_m2 = 0.0;
  int pictures = 12;
  bool are_on() const { return period_s > 0.0 || new_area_m2 > 0.0; }
  template <class Visitor>
  void describe(Visitor& v) {
    v.number("period_s", period_s, 0.0, 86400.0,
             "recorded time in seconds between two rounds in which edges and cloud fuse the laser maps so far, as "
             "previews; larger values make fewer rounds; 0: none by time");
    v.non_negative("new_area_m2", new_area_m2,
                   "area in square metres that robots see for the first time, all together, after which the next round "
                   "of previews comes; larger values make fewer rounds; 0: none by area");
    v.integer("pictures", pictures, 0, 1000,
              "most pictures of joint maps so far that are written of the rounds, spread over the run; larger values "
              "show more of them");
  }
};

// One round, at a time of the team.
struct RoundWork {
  double at_s = 0.0;
  struct Sent {
    RobotId robot;
    TierId to;  // empty: the cloud
    std::uint64_t bytes = 0;
  };
  std::vector<Sent> robots;  // what they sent since the last round: what they sensed, or of a map what is new
  struct Pair {
    MapId a, b;
    Decision decision = Decision::deferred;
    Reason reason = Reason::none;
    double probability = 0.0;
  };
  struct Fused {
    TierId tier;
    double fusing_s = 0.0;                       // seconds of one core of this machine
    std::uint64_t bytes = 0;                     // what an edge sent to the cloud
    double speed = 1.0;                          // speed of the edge's processor (EdgeWork::speed)
    std::size_t maps = 0;                        // robots' maps that the tier has
    std::vector<std::vector<MapId>> joint = {};  // maps that are one now: two or more each
    std::vector<Pair> pairs = {};                // pairs that the tier merged or refused
  };
  std::vector<Fused> fused;  // edges by name, then the cloud; only tiers that received something new
};

// When previews were ready, in seconds of the team's time.
struct RoundsTimeline {
  struct Ready {
    double ready_s = 0.0;
    bool is_left_out = false;  // the tier was still busy with the round before: it takes all with the next one
  };
  std::vector<std::vector<Ready>> rounds;  // for each round, in the order of RoundWork::fused
  struct Joint {
    TierId tier;
    std::vector<MapId> maps;
    double at_s = 0.0, ready_s = 0.0;  // time of its data; time when it was ready
  };
  std::optional<Joint> first_joint;
  struct Tier {
    TierId tier;
    std::size_t fused = 0, left_out = 0;
    double most_age_s = 0.0;    // age of its preview, from the first one until the recordings ended
    double slowest_s = 0.0;     // longest round, from the arrival of maps to its preview
    double fusing_cpu_s = 0.0;  // processor time of all its rounds
    std::uint64_t bytes = 0;    // sent to the cloud in all its rounds
  };
  std::vector<Tier> tiers;  // edges by name, then the cloud
};

struct TimelineOptions;
struct Work;
// `work` must hold its rounds and the speeds of its edges.
RoundsTimeline rounds_timeline(const TimelineOptions&, const Work&);

// As JSON for timeline_json(), and read back. Throws Error(kBadInput) as read_work().
nlohmann::ordered_json rounds_timeline_json(const RoundsTimeline&, const std::vector<RoundWork>&);
std::vector<RoundWork> read_rounds(const nlohmann::json& rounds, const std::string& where);
// rounds.json: a line for each round. `timeline`: null where the run was interrupted; pictures by round.
std::string rounds_json_text(const std::vector<RoundWork>&, const RoundsTimeline* timeline,
                             const std::map<std::size_t, std::string>& pictures);
// Text for people, a line each; empty without rounds.
std::string in_words(const RoundsTimeline&, std::size_t rounds);
// Notes where rounds come faster than tiers fuse.
std::vector<std::string> notes_of(const RoundsTimeline&);

}  // namespace mapweave::runtime
