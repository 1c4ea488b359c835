#pragma once
// How good this robot's wheels (or its gyroscope) and its scan matches are at headings, learned while it drives.

#include <deque>
#include <optional>

namespace mapweave::laser {

// By scan matching alone. The standard deviation is that of points whose errors are independent.
struct MatchedHeading {
  double heading_rad = 0.0, sigma_rad = 0.0;
};

// Compares turns by odometry with turns by scan matching over stretches of path: odometry errs more over longer ones,
// matches do not. A match that knew of the odometry would agree with it whatever the odometry is worth, so those asked
// for here must not.
class HeadingQuality {
 public:
  // One step of the robot: its length, and its turn by odometry with the standard deviation that the options expect of
  // it.
  void add_step(double length_m, double turn_rad, double sigma_rad);
  void add_gap() { start_rad_.reset(); }  // where there is no odometry
  // Whether the stretch is long enough to be closed by a heading from scan matching alone (or none where the match
  // failed), or its first step is.
  bool wants_heading() const;
  void add_heading(std::optional<MatchedHeading> matched);
  // What to multiply expected standard deviations with; 1 until enough is known. The median of what was seen lately:
  // missed turns are rare, large, and a matter of the prior's gate.
  double factor() const { return factor_; }
  // Information of matches relative to that of points whose errors are independent, in (0, 1]: from first steps, less
  // what odometry errs in them. Nothing until enough is known.
  std::optional<double> match_information() const { return match_information_; }

 private:
  struct FirstStep {  // of a stretch
    double apart_rad, odometry_variance, match_variance;
  };
  void add_first_step(const MatchedHeading& matched);
  double apart_rad(const MatchedHeading& matched) const;  // turn by matches less turn by odometry

  std::optional<double> start_rad_;  // none: the next heading begins a stretch
  double length_m_ = 0.0, turn_rad_ = 0.0, variance_ = 0.0;
  bool first_step_is_taken_ = false;
  std::deque<double> ratios_;  // of stretches: what they are apart by, in expected standard deviations
  std::deque<FirstStep> first_steps_;
  double factor_ = 1.0;
  std::optional<double> match_information_;
};

}  // namespace mapweave::laser
