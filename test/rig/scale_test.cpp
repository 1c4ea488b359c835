#include <mapweave/rig/scale.h>

#include <gtest/gtest.h>

namespace mapweave::rig {
namespace {

const Eigen::Vector3d kOff(0.3, -0.2, 0.6);  // of the camera

TEST(Scale, of_one_moves_nodes_as_they_are) {
  const Pose3 node{{0.3, 1.7, 0.2},
                   Eigen::Quaterniond(Eigen::AngleAxisd(0.7, Eigen::Vector3d(0.1, 0.3, 1.0).normalized()))},
      there{{-2.1, 0.4, 0.9}, Eigen::Quaterniond(Eigen::AngleAxisd(-1.1, Eigen::Vector3d(0.2, 0.1, 1.0).normalized()))},
      camera{kOff, Eigen::Quaterniond::Identity()};
  const Pose3 placed = moved_with_camera({there, 1.0}, node, camera), known = transformed(node, Sim3{there, 1.0});
  EXPECT_EQ(placed.t, known.t);
  EXPECT_EQ(placed.q.coeffs(), known.q.coeffs());
  EXPECT_EQ(rescaled(node.t, camera, 1.0), node.t);
  const Pose3 grown = moved_with_camera({there, 2.0}, node, camera), frame = frame_by_node(grown, node, camera, 2.0);
  EXPECT_LT((transformed(2.0 * transformed(kOff, node), there) - transformed(kOff, grown)).norm(), 1e-12);
  EXPECT_LT((frame.t - there.t).norm(), 1e-12);
}

}  // namespace
}  // namespace mapweave::rig
