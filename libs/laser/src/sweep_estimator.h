#pragma once
// How long a laser takes from its first ray to its last, and how late its scans are stamped, learned from the scans of
// a robot that turns. A scan taken while turning is bent against one of the same walls taken while turning less; and
// where a turn begins or ends, a late scan shows less of it than odometry.

#include <mapweave/core/stamp.h>
#include <mapweave/laser/graph_options.h>
#include <mapweave/maps/scan.h>
#include <mapweave/matching/wall_point.h>

#include <deque>
#include <optional>
#include <utility>
#include <vector>

namespace mapweave::laser {

struct Estimated {
  double value = 0.0, sigma = 0.0;  // the latter from how blocks of pairs differ
};

struct SweepEstimate {
  Estimated sweep_s;  // from the first ray to the last; negative where rays were measured in the opposite order
  // By odometry; nullopt where there is none that fits.
  struct ByOdometry {
    Estimated delay_s;     // of a scan's stamp after the middle of its sweep
    Estimated turn_scale;  // the robot's turns as scans show them, by those of odometry: estimated so that it does not
                           // pass for a delay
  };
  std::optional<ByOdometry> by_odometry;
  int pairs = 0;  // of scans compared
};

class SweepEstimator {
 public:
  explicit SweepEstimator(const SweepOptions& options) : options_(options) {}

  void add_odometry(Stamp stamp, const Pose2& odometry_from_robot);
  // The next scan, its geometry without a sweep, and where the robot was when it was taken; `matched`: found by scan
  // matching.
  void add(Stamp stamp, const PackedScan& scan, const Pose2& local_from_robot, bool matched);
  // Decides with what there is.
  void finish();
  bool is_decided() const { return decided_; }
  // What holds, once decided; 0: nothing.
  double sweep_s() const { return sweep_s_; }
  double delay_s() const { return delay_s_; }
  const SweepEstimate& estimate() const { return estimate_; }  // of the last decision, or attempt

 private:
  struct SeenScan {
    Stamp stamp;
    PackedScan scan;
    Pose2 local_from_robot;
    bool matched;
    std::optional<Pose2> velocity;  // once the next scan is known
  };
  // A wall point; `turned_rad` is its ray's angle from the first ray on, `part` its time from the middle of the sweep,
  // in sweeps.
  struct RayPoint {
    float x, y, normal_x, normal_y, turned_rad, part;
  };
  // How far around a laser its rays have come.
  struct Fan {
    Eigen::Matrix2f laser_from_robot;
    Eigen::Vector2f origin;
    float first_rad, direction, span_rad;
    explicit Fan(const ScanGeometry&);
    float turned_rad(float x, float y) const;
  };
  struct Side {
    Stamp stamp;
    Pose2 velocity;
    std::vector<RayPoint> points;  // by turned_rad
  };
  struct Pair {
    Side first, second;
    Fan fan;
    Pose2 first_from_second;
    bool fits = false;  // enough points found each other
  };
  // What a pair says of one number, all else eliminated: information * change = gain.
  struct Vote {
    double information = 0.0, gain = 0.0;
  };
  static Side side_of(const SeenScan& seen, std::size_t most);
  static Vote vote(Pair& pair, double sweep_s, int steps);
  static Estimated summed(double value, const std::vector<Vote>& votes);
  void add_pair();
  std::optional<Pose2> odometry_at(Stamp stamp) const;
  std::optional<Pose2> odometry_velocity(Stamp stamp) const;
  std::optional<double> odometry_turn(const Pair& pair, double delay_s) const;
  double agreement(double delay_s, double turn_scale) const;
  std::optional<double> likeliest_delay() const;
  std::optional<SweepEstimate::ByOdometry> compare_with_odometry() const;
  std::optional<SweepEstimate::ByOdometry> fitted(double delay_s, bool with_delay) const;
  void take_velocities_from_odometry(double delay_s, double turn_scale);
  void evaluate();
  void decide(bool is_last);

  SweepOptions options_;
  bool decided_ = false;
  double sweep_s_ = 0.0, delay_s_ = 0.0;
  std::deque<SeenScan> seen_;                      // of late
  std::vector<std::pair<Stamp, Pose2>> odometry_;  // phi not wrapped
  std::vector<Pair> pairs_;
  std::size_t scans_ = 0, next_evaluation_ = 0;
  std::optional<Stamp> last_pair_;
  SweepEstimate estimate_;
};

}  // namespace mapweave::laser
