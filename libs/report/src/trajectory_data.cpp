#include "trajectory_data.h"

#include <algorithm>
#include <cmath>

namespace mapweave::report {
namespace {

// Differences of rounded values, so that errors do not add up.
class Differences {
 public:
  explicit Differences(double unit) : unit_(unit) {}
  void add(double value) {
    const auto whole = static_cast<std::int64_t>(std::llround(std::clamp(value / unit_, -1e15, 1e15)));
    json.push_back(whole - before_);
    before_ = whole;
  }
  Json json = Json::array();

 private:
  double unit_;
  std::int64_t before_ = 0;
};

}  // namespace

Json trajectory_json(const evaluation::Trajectory& trajectory, std::size_t most) {
  Differences t(1e-3), x(1e-3), y(1e-3), yaw(1e-3);
  const std::size_t count = std::min(trajectory.size(), most);
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t place = count == 1 ? 0 : i * (trajectory.size() - 1) / (count - 1);
    const evaluation::TrajectoryPoint& point = trajectory[place];
    t.add(seconds_between(trajectory.front().stamp, point.stamp));
    x.add(point.pose.t.x());
    y.add(point.pose.t.y());
    yaw.add(planar(point.pose).phi);
  }
  return {{"first_s", trajectory.front().stamp.seconds()},
          {"t_ms", t.json},
          {"x_mm", x.json},
          {"y_mm", y.json},
          {"yaw_mrad", yaw.json}};
}

}  // namespace mapweave::report
