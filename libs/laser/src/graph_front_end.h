#pragma once
// Local SLAM: each scan matched to the submap under way. Drifts; never jumps.

#include "heading_quality.h"
#include "inertial_calibration.h"
#include "motion_tracks.h"

#include <mapweave/laser/graph_options.h>
#include <mapweave/laser/laser_mapper.h>
#include <mapweave/matching/scan_matcher.h>

#include <deque>
#include <optional>

namespace mapweave::laser {

class FrontEnd {
 public:
  // Scans show what was there `sweep.delay_s` before their stamps: there odometry is looked up.
  FrontEnd(SessionId session, const FrontEndOptions& options, const SweepOptions& sweep)
      : session_(session),
        options_(options),
        delay_ns_(std::llround(sweep.delay_s * 1e9)),
        calibration_(options.inertial_sigma_yaw_rad, options.inertial_sigma_yaw_per_rad) {}

  void add_odometry(const OdometryInput& odometry);
  // How long after a scan's stamp its last ray was measured: odometry until then helps. 0: no need to wait.
  double needs_until_s(const ScanInput& input) const;
  void add_inertial(const InertialInput& inertial) { inertial_.add(inertial.stamp, inertial.yaw_rad); }
  // Whether the next reading of the inertial unit, which is believed, is worth waiting for.
  bool awaits_inertial(const ScanInput& input) const;
  const InertialCalibration& calibration() const { return calibration_; }
  // Where the laser sweeps, the scan becomes content with the robot's motion during the sweep: of odometry and the
  // inertial unit, or else of the matches. Readings after the scan's stamp that were added before it help. Appends a
  // node (map_from_node: in the local frame), its constraints, and what changed of submaps to `map`. Returns the number
  // of submaps that were frozen.
  int add_scan(const ScanInput& scan, Map& map);
  const Pose2& local_from_last() const { return local_from_last_; }  // where the last scan was taken
  bool last_is_matched() const { return last_is_matched_; }
  // Freezes what is left. A submap under way that is wholly part of the one before it is dropped. Returns the number of
  // submaps that were frozen.
  int finish(Map& map);

 private:
  struct Active {
    SubmapId id;
    Pose2 local_from_submap;
    double started_at_m;  // path travelled
    int scans = 0;
    matching::WallField field;
  };
  // From the last scan to the next, as it is expected.
  struct Step {
    Pose2 motion, predicted;                        // local_from_robot
    bool from_odometry = false, from_unit = false;  // from_unit: the turn is that of the inertial unit
    std::optional<double> measured_turn_rad;        // as the inertial unit gives it
    double seconds = 0.0, distance_m = 0.0, turn_rad = 0.0;
    matching::PriorWeight prior;
  };
  struct Matched {
    bool is_found = false;
    double score = 0.0;           // of matching::ScanMatch
    std::optional<Pose2> coarse;  // submap_from_node, where anything was searched
    Pose2 submap_from_node, local_from_node;
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  };
  // A scan on its way into the map.
  struct Taken {
    ScanInput input;  // with the motion of its sweep
    Pose2 velocity;   // that this motion was taken from at first
    std::vector<matching::WallPoint> points, few;
  };
  Stamp taken_at(Stamp stamp) const { return {stamp.ns - delay_ns_}; }
  std::vector<matching::WallPoint> matched_points(const PackedScan& scan,
                                                  const std::vector<matching::WallPoint>& all) const;
  Taken take(const ScanInput& given) const;
  void see(Taken& taken) const;  // the points, under the motion of the sweep
  Step next_step(Stamp stamp);
  bool follow(const NodeId& id, const ScanInput& given, Taken& taken, Map& map);
  bool turns_suddenly(const Taken& taken, const Step& step) const;
  Matched match_moving(const ScanInput& scan, const Pose2& velocity, Taken& taken, const Step& step);
  Matched match_sweep(const ScanInput& given, Taken& taken, const Step& step);
  Matched match(const std::vector<matching::WallPoint>& few, const Step& step);
  void turn_by_unit(Step& step) const;
  double point_information_scale() const;  // as the option has it, until matches are known to be better
  std::optional<MatchedHeading> free_heading(const std::vector<matching::WallPoint>& few,
                                             const Pose2& submap_from_scan) const;
  void learn_heading(const Taken& taken, const Step& step, const Matched& found);
  Pose2 sweep_velocity(const ScanInput& input) const;  // per second, in the robot's frame at the stamp
  // How the robot moved from a scan's stamp on, or before it, as odometry and the inertial unit say.
  std::optional<Pose2> motion_after(Stamp stamp, double seconds) const;
  std::optional<Pose2> corrected_velocity(const ScanInput& input, const Pose2& velocity, const Step& step,
                                          const Matched& found) const;
  Pose2 predict(Stamp stamp, bool& from_odometry) const;
  // What is known of the motion from the last scan, odometry or not; `matched_motion`: what a match found.
  Constraint motion_constraint(const NodeId& id, const Step& step, const std::optional<Pose2>& matched_motion) const;
  int draw(const Node& node, const std::vector<matching::WallPoint>& points, Map& map);  // submaps that it froze
  void insert(const Node& node, const std::vector<matching::WallPoint>& points, Map& map);
  void freeze(Active& active, Map& map);
  void start_submap(const Pose2& local_from_node, Map& map);

  SessionId session_;
  FrontEndOptions options_;
  std::int64_t delay_ns_;
  OdometryTrack odometry_;
  InertialTrack inertial_;
  InertialCalibration calibration_;
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
  bool last_is_matched_ = false;
};

}  // namespace mapweave::laser
