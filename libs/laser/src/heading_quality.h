#pragma once
// How good this robot's wheels (or its gyroscope) are at headings, learned while it drives.

#include <deque>
#include <optional>

namespace mapweave::laser {

// Compares turns by odometry with turns by scan matching over stretches of path. A match that knew of the odometry
// would agree with it whatever the odometry is worth, so those asked for here must not.
class HeadingQuality {
 public:
  // One step of the robot: its length, and its turn by odometry with the standard deviation that the options expect of
  // it.
  void add_step(double length_m, double turn_rad, double sigma_rad);
  // Whether the stretch is long enough to be closed by a heading from scan matching alone (or none where the match
  // failed).
  bool wants_heading() const { return length_m_ >= kStretch_m || !start_; }
  void add_heading(std::optional<double> heading_rad);
  // What to multiply expected standard deviations with; 1 until enough is known. The median of what was seen lately:
  // missed turns are rare, large, and a matter of the prior's gate.
  double factor() const { return factor_; }

 private:
  static constexpr double kStretch_m = 5.0;  // of path between two headings that are compared
  std::optional<double> start_;
  double length_m_ = 0.0, turn_rad_ = 0.0, variance_ = 0.0;
  std::deque<double> ratios_;
  double factor_ = 1.0;
};

}  // namespace mapweave::laser
