#pragma once
// How long it takes until the global map is there (RecSLAM IV-A, eq. 1 to 4), each term a parameter:
//   t_r = pack + robot -> edge + SLAM on the edge                          (1), by robot
//   t_e = max over its robots of t_r + fusion of its maps                  (2), by edge
//   t_c = max over edges of (t_e + edge -> cloud) + fusion of edge maps    (3)
// Defaults are for this program on one core of an EPYC (all runs of the RecSLAM tables in datasets/RESULTS.md
// together); `mapweave profile` learns them from earlier runs.

#include <mapweave/scheduling/problem.h>

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace mapweave::scheduling {

// Maps that are fused: how many scans they hold together, over each two of them the product of theirs, which is what is
// judged, and over each two robots the scans that both saw (their overlap degree times the sum of theirs), which are
// matched again. On an edge, of its robots; in the cloud, of edges, each as if its robots were one: their pairs were
// judged before, and these judgements are sent with them. Pairs across edges are shared out to all edges that are used
// (tiers/judging_task.h), equally whatever their speeds: what counts is the share of the slowest.
struct FusedScans {
  double scans = 0.0, pairs = 0.0, shared = 0.0;
  void share_out(double edges) { pairs /= edges; }
  void add(double of_map) {
    pairs += scans * of_map;
    scans += of_map;
  }
};

// Quadratic in the number of scans, as RecSLAM's fig. 7a and 11 have it: what is matched are pairs. All parts are 0 or
// more.
struct FusionTime {
  double fixed_s = 0.0, per_scan_s = 0.0, per_scan_pair_s = 0.0, per_shared_scan_s = 0.0;
  double seconds(const FusedScans& fused) const {
    return fixed_s + per_scan_s * fused.scans + per_scan_pair_s * fused.pairs + per_shared_scan_s * fused.shared;
  }
};

// What one edge is like, as its own runs have shown, at its speed of 1; in what is not said here it is as all are.
struct EdgeLatency {
  std::optional<double> slam_s_per_scan, bytes_per_map_byte;
  std::optional<FusionTime> fusion;
};

struct LatencyModel {
  double scans = 1000.0;           // of a robot of which nothing is said
  double pack_s_per_scan = 5e-6;   // on the robot
  double robot_bytes_fixed = 0.0;  // robot -> edge, beside its scans: none where it sends what it senses
  double scan_bytes = 600.0;       // a packed scan of 180 rays on the wire, with stamp, odometry and envelope
  double robot_bytes_per_s =
      2.5e6;  // robot -> edge where the problem names no link: 20 Mbit/s of wireless network for each
  double robot_delay_s = 0.005;
  double slam_s_per_scan = 0.0007;                // on an edge of speed 1
  FusionTime edge_fusion{0.0, 0.0, 2.8e-7, 0.0};  // on an edge of speed 1
  double map_bytes_per_scan = 650.0;              // of a robot's map as it is sent on
  double map_bytes_fixed = 20e3;
  // What an edge sends on of its robots' maps: each place once, and what it found between them.
  double edge_bytes_per_map_byte = 0.22;
  double cloud_delay_s = 0.02;                    // edge -> cloud, of an edge of which nothing is said
  FusionTime cloud_fusion{0.0, 0.0, 4e-7, 4e-5};  // of edge maps, at speed 1; its pairs where CloudResources says
  std::map<std::string, EdgeLatency> edges = {};  // by name: those that differ
};

// As `mapweave profile` writes it: a JSON object whose keys are the fields above (fusions as objects); what is missing
// has its default. Throws Error naming file and key.
LatencyModel read_model(const std::filesystem::path&);
LatencyModel parse_model(std::string_view json, const std::string& where);
std::string model_json(const LatencyModel&);

// The terms of eq. 1 to 3 for one placement, each in seconds, so that a run can be compared with them one by one.
struct LatencyTerms {
  struct RobotTerms {
    std::uint32_t robot = 0;
    double pack_s = 0.0, transfer_s = 0.0, slam_s = 0.0;
    double seconds() const { return pack_s + transfer_s + slam_s; }  // eq. 1
  };
  struct EdgeTerms {  // without robots: 0 throughout
    std::vector<RobotTerms> robots;
    double fusion_s = 0.0, transfer_s = 0.0;  // transfer: to the cloud
    double computing_seconds() const;         // eq. 2
    double seconds() const { return computing_seconds() + transfer_s; }
  };
  std::vector<EdgeTerms> edges;
  double fusion_s = 0.0;         // in the cloud, with what edges judge for it
  double total_seconds() const;  // eq. 3
};

// What the model says of one problem. The problem and the model must outlive it. Immutable; thread-safe.
class Latency {
 public:
  Latency(const Problem&, const LatencyModel&);

  double scans(std::uint32_t robot) const { return problem_.scans[robot].value_or(model_.scans); }
  double robot_seconds(std::uint32_t robot, std::uint32_t edge) const {
    return robot_terms(robot, edge).seconds();
  }  // eq. 1
  double map_bytes(std::uint32_t robot) const { return map_bytes_[robot]; }
  // Of the map that they make together, by inclusion and exclusion over overlap degrees (RecSLAM V): what two maps
  // share is their degree times both sizes; common parts of three and more are taken as independent. Never less than
  // the largest of them. `robots` ascending. Algorithm 3 places by it; what our edges send: sent_bytes.
  double fused_bytes(const std::vector<std::uint32_t>& robots) const;
  // What an edge sends to the cloud for this robot, whoever else is there: its share of what all come to.
  double sent_bytes(std::uint32_t robot, std::uint32_t edge) const {
    return edge_models_[edge].bytes_per_map_byte * map_bytes_[robot];
  }
  const FusionTime& edge_fusion(std::uint32_t edge) const { return edge_models_[edge].fusion; }
  double cloud_delay_s(std::uint32_t edge) const { return problem_.edges[edge].delay_s.value_or(model_.cloud_delay_s); }
  double shared_scans() const { return all_shared_; }  // FusedScans::shared of all robots
  // From the beginning until the edge's map is in the cloud: eq. 2 and its part of eq. 3; 0 without robots.
  double edge_seconds(const std::vector<std::uint32_t>& robots, std::uint32_t edge) const;
  double computing_seconds(const std::vector<std::uint32_t>& robots, std::uint32_t edge) const;  // eq. 2 alone
  // Eq. 3. `robots_at`: by edge, ascending; a robot may be at several.
  LatencyTerms terms(const std::vector<std::vector<std::uint32_t>>& robots_at) const;
  // Of the cloud, with what edges judge for it; by edge, the scans of its robots' maps, 0 where it has none.
  double cloud_seconds(const std::vector<double>& scans_at) const;
  double total_seconds(const std::vector<std::vector<std::uint32_t>>& robots_at) const {
    return terms(robots_at).total_seconds();
  }

  const Problem& problem() const { return problem_; }
  const LatencyModel& model() const { return model_; }

 private:
  LatencyTerms::RobotTerms robot_terms(std::uint32_t robot, std::uint32_t edge) const;
  LatencyTerms::EdgeTerms edge_terms(const std::vector<std::uint32_t>& robots, std::uint32_t edge) const;
  double shared_part(std::uint32_t robot, std::uint32_t other, double degree) const;  // of robot's map, 0 to 1
  double shared_scans(const std::vector<std::uint32_t>& robots) const;                // FusedScans::shared
  double shared_scans(std::uint32_t robot, const Neighbour& other) const;             // of these two
  struct EdgeModel {                                                                  // of each edge of the problem
    double slam_s_per_scan, bytes_per_map_byte;
    FusionTime fusion;
  };
  const Problem& problem_;
  const LatencyModel& model_;
  std::vector<EdgeModel> edge_models_;
  std::vector<double> map_bytes_;
  double all_shared_ = 0.0;
};

}  // namespace mapweave::scheduling
