#pragma once
// What an inertial unit's turns are worth, learned while the robot drives: their scale (negative where the unit hangs
// upside down), their bias and their noise.

#include <deque>
#include <optional>
#include <string>

namespace mapweave::laser {

// Compares turns by the unit with turns by scan matching over stretches of a third of a radian or three seconds. A
// match that knew of the unit would agree with it whatever it is worth, so the headings asked for here must not.
class InertialCalibration {
 public:
  // Expected of a step between two scans: standard deviation of its turn, and how that grows with the turn.
  InertialCalibration(double sigma_rad, double sigma_per_rad) : sigma_rad_(sigma_rad), sigma_per_rad_(sigma_per_rad) {}

  // One step of the robot: its turn as the unit measured it, and as it was matched.
  void add_step(double seconds, double measured_turn_rad, double matched_turn_rad);
  // A step that was not measured or not matched: the stretch under way counts for nothing.
  void add_gap() { start_.reset(); }
  // Whether the stretch is long enough to be closed by a heading from scan matching alone.
  bool wants_heading() const;
  void add_heading(std::optional<double> heading_rad);  // none where the match failed

  // Once the unit turned as the scans did over enough turns; the other way round counts as upside down.
  bool is_believed() const { return is_believed_; }
  // Of a step, and its standard deviation. Contract: the unit is believed.
  double turn_rad(double seconds, double measured_turn_rad) const;
  double turn_sigma_rad(double seconds, double turn_rad) const;
  bool is_known() const { return !stretches_.empty(); }  // there is a unit, and it was compared
  // For people. doubt: why the unit is not believed, or how it is mounted otherwise than the log says; nullopt where
  // there is nothing to say, or too few turns to judge by.
  std::optional<std::string> doubt() const;
  std::string described() const;

 private:
  struct Stretch {
    double seconds, measured_rad, matched_rad, variance;
  };
  void close(double heading_rad);
  void learn();
  void weigh();
  double residual_rad(const Stretch& stretch) const;
  double share_of_turns() const;  // that scale and bias leave unexplained

  double sigma_rad_, sigma_per_rad_;
  std::optional<double> start_;  // heading where the stretch under way began
  Stretch current_{};
  std::deque<Stretch> stretches_;  // of late
  double turned_ = 0.0;            // sum of their squares, square radians
  double scale_ = 1.0, bias_rad_s_ = 0.0, noise_factor_ = 1.0;
  double scale_sigma_ = 1.0, bias_sigma_rad_s_ = 1.0;
  bool is_believed_ = false;
};

}  // namespace mapweave::laser
