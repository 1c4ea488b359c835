#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/exporters/trajectory_plot.h>

#include <cmath>

namespace mapweave::exporters {
namespace {

PlottedTrack circle(const std::string& name, double off_m) {
  PlottedTrack track{name, {}};
  for (int i = 0; i < 200; ++i) {
    const Eigen::Vector3d at(10.0 * std::cos(0.03 * i), 0.0, 10.0 * std::sin(0.03 * i));
    track.poses.push_back({0.1 * i, at * (1.0 + off_m * 0.001 * i), at});
  }
  return track;
}

TEST(TrajectoryPlot, shows_several_runs_and_one_that_stood_still) {
  const std::vector<PlottedTrack> two = {circle("first <&> \xc3\xa9", 0.1), circle("second", 0.3)};
  const std::string png = trajectory_plot_png(two, "errors");
  EXPECT_EQ(png.substr(1, 3), "PNG");
  EXPECT_EQ(png, trajectory_plot_png(two, "errors"));
  EXPECT_EQ(trajectory_plot_png({{"", {{5.0, Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero()}}}}, "").substr(1, 3),
            "PNG");
  EXPECT_THROW(trajectory_plot_png({}, ""), ContractViolation);
}

}  // namespace
}  // namespace mapweave::exporters
