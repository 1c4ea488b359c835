#pragma once
// Local SLAM: each scan matched to the submap under way. Drifts; never jumps.

#include "heading_quality.h"

#include <mapweave/laser/graph_options.h>
#include <mapweave/laser/laser_mapper.h>
#include <mapweave/matching/scan_matcher.h>

#include <deque>
#include <optional>

namespace mapweave::laser {

// Accumulated odometry at any stamp: between readings by interpolation, shortly after the last one by going on as before.
class OdometryTrack {
 public:
  void add(Stamp stamp, const Pose2& odometry_from_robot);
  std::optional<Pose2> at(Stamp stamp) const;  // nullopt before the first reading and long after the last

 private:
  std::deque<std::pair<Stamp, Pose2>> readings_;
};

class FrontEnd {
 public:
  FrontEnd(SessionId session, const FrontEndOptions& options) : session_(session), options_(options) {}

  void add_odometry(const OdometryInput& odometry);
  // Appends a node (map_from_node: in the local frame), its constraints, and what changed of submaps to `map`. Returns the number of
  // submaps that were frozen.
  int add_scan(const ScanInput& scan, Map& map);
  // Freezes what is left. A submap under way that is wholly part of the one before it is dropped. Returns the number of submaps that were
  // frozen.
  int finish(Map& map);

 private:
  struct Active {
    SubmapId id;
    Pose2 local_from_submap;
    double started_at_m;  // path travelled
    int scans = 0;
    matching::WallField field;
  };
  Pose2 predict(Stamp stamp, bool& from_odometry) const;
  void insert(const Node& node, const std::vector<matching::WallPoint>& points, Map& map);
  void freeze(Active& active, Map& map);
  void start_submap(const Pose2& local_from_node, Map& map);

  SessionId session_;
  FrontEndOptions options_;
  OdometryTrack odometry_;
  HeadingQuality heading_quality_;
  std::deque<Active> active_;  // one or two; the older is matched against
  std::uint32_t next_node_ = 0, next_submap_ = 0;
  double travelled_m_ = 0.0;
  int lost_ = 0;  // scans in a row that fitted nowhere, without odometry
  std::optional<Stamp> last_stamp_;
  Pose2 local_from_last_, local_from_inserted_;
  Pose2 last_motion_;  // of the robot, per second: what stands in for odometry
  std::optional<Pose2> last_odometry_;
  std::optional<NodeId> last_node_;
};

}  // namespace mapweave::laser
