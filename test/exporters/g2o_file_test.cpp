#include "small_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/exporters/g2o_file.h>

#include <sstream>

namespace mapweave::exporters {
namespace {

using test::add_pose;
using test::node_id;
using ::testing::HasSubstr;

Constraint edge(const NodeId& from, const NodeId& to, ConstraintKind kind = ConstraintKind::odometry) {
  Constraint constraint;
  constraint.id.kind = kind;
  constraint.id.from = from;
  constraint.id.to = to;
  return constraint;
}

void add(Map& map, const Constraint& constraint) { map.constraints.set(constraint.id, constraint); }

// a symmetric matrix with a different number in each place.
Eigen::Matrix<double, 6, 6> given_information() {
  Eigen::Matrix<double, 6, 6> information;
  for (int row = 0; row < 6; ++row)
    for (int column = row; column < 6; ++column)
      information(row, column) = information(column, row) = 100.0 * (row == column) + 6 * row + column;
  return information;
}

TEST(G2oText, numbers_planar_nodes_in_the_order_of_their_ids) {
  Map map;
  add_pose(map, node_id("beta", 0), 1, spatial(Pose2(5.0, 0.0, 0.0)));
  add_pose(map, node_id("alpha", 0), 1, spatial(Pose2(0.0, 0.0, 0.0)));
  add_pose(map, node_id("alpha", 1), 2, spatial(Pose2(0.1, -0.25, 0.0)));
  add_pose(map, node_id("alpha", 5), 3, spatial(Pose2(1.0, 0.0, 0.0)));
  Eigen::Matrix3d information;
  information << 400.0, 1.0, 2.0, 1.0, 500.0, 3.0, 2.0, 3.0, 600.0;
  map.constraints.set({ConstraintKind::odometry, node_id("alpha", 0), node_id("alpha", 1), 0},
                      planar_constraint({ConstraintKind::odometry, node_id("alpha", 0), node_id("alpha", 1), 0},
                                        Pose2(0.1, -0.25, 0.0), information));
  map.constraints.set({ConstraintKind::loop, node_id("beta", 0), node_id("alpha", 5), 0},
                      planar_constraint({ConstraintKind::loop, node_id("beta", 0), node_id("alpha", 5), 0},
                                        Pose2(-4.0, 0.0, 0.0), information));
  EXPECT_EQ(g2o_text(map),
            "# 4 vertices, 2 constraints\n"
            "# vertices 0 to 1: " +
                to_string(node_id("alpha", 0).session) +
                ", nodes 0 to 1\n"
                "# vertices 2 to 2: " +
                to_string(node_id("alpha", 0).session) +
                ", nodes 5 to 5\n"
                "# vertices 3 to 3: " +
                to_string(node_id("beta", 0).session) +
                ", nodes 0 to 0\n"
                "VERTEX_SE2 0 0 0 0\n"
                "VERTEX_SE2 1 0.1 -0.25 0\n"
                "VERTEX_SE2 2 1 0 0\n"
                "VERTEX_SE2 3 5 0 0\n"
                "FIX 0\n"
                "EDGE_SE2 0 1 0.1 -0.25 0 400 1 2 500 3 600\n"
                "EDGE_SE2 3 2 -4 0 0 400 1 2 500 3 600\n");
}

TEST(G2oText, keeps_all_digits_of_a_pose) {
  Map map;
  const Pose2 pose(1.0 / 3.0, -1e-7 / 3.0, 2.0 / 3.0);
  add_pose(map, node_id("alpha", 0), 1, spatial(pose));
  const std::string text = g2o_text(map);
  std::istringstream words(text.substr(text.find("VERTEX_SE2 0 ") + 13));
  double x = 0.0, y = 0.0, yaw = 0.0;
  words >> x >> y >> yaw;
  EXPECT_EQ(x, pose.x);
  EXPECT_EQ(y, pose.y);
  EXPECT_EQ(yaw, planar(spatial(pose)).phi);
}

// g2o's error of a small motion (t, turn vector r) is (t, r / 2): the cost must be what the constraint says.
TEST(G2oText, of_a_map_in_space_costs_a_small_motion_what_the_constraint_does) {
  Map map;
  add_pose(map, node_id("alpha", 0), 1, {});
  add_pose(map, node_id("alpha", 1), 2, {{0.0, 0.0, 1.0}, Eigen::Quaterniond(0.5, 0.5, 0.5, 0.5)});
  Constraint constraint = edge(node_id("alpha", 0), node_id("alpha", 1));
  constraint.from_from_to.pose = {{1.0, 2.0, 3.0}, Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5)};
  constraint.information = given_information();
  add(map, constraint);
  const std::string text = g2o_text(map);
  EXPECT_THAT(text, HasSubstr("VERTEX_SE3:QUAT 1 0 0 1 0.5 0.5 0.5 0.5\n"));
  const std::string head = "EDGE_SE3:QUAT 0 1 1 2 3 0.5 -0.5 0.5 0.5";
  ASSERT_THAT(text, HasSubstr(head));
  std::istringstream words(text.substr(text.find(head) + head.size()));
  Eigen::Matrix<double, 6, 6> written;
  for (int row = 0; row < 6; ++row)
    for (int column = row; column < 6; ++column) {
      words >> written(row, column);
      written(column, row) = written(row, column);
    }
  ASSERT_TRUE(words);
  Eigen::Matrix<double, 6, 1> motion;
  motion << 0.01, -0.02, 0.03, 0.004, 0.005, -0.006;
  Eigen::Matrix<double, 6, 1> error_of_g2o = motion;
  error_of_g2o.tail<3>() /= 2.0;
  EXPECT_NEAR(error_of_g2o.dot(written * error_of_g2o), motion.dot(constraint.information * motion), 1e-12);
}

TEST(G2oText, leaves_out_priors_and_says_so) {
  Map map;
  add_pose(map, node_id("alpha", 0), 1, {});
  Constraint prior = edge(node_id("alpha", 0), node_id("alpha", 0), ConstraintKind::prior);
  prior.information = given_information();
  add(map, prior);
  const std::string text = g2o_text(map);
  EXPECT_THAT(text, HasSubstr("VERTEX_SE2 0"));
  EXPECT_THAT(text, HasSubstr("# left out: 1 priors\n"));
  EXPECT_EQ(text.find("EDGE"), std::string::npos);
}

TEST(G2oText, refuses_what_a_pose_graph_cannot_say) {
  Map map;
  add_pose(map, node_id("alpha", 0), 1, {});
  add_pose(map, node_id("alpha", 1), 2, {});
  Constraint scaled = edge(node_id("alpha", 0), node_id("alpha", 1));
  scaled.from_from_to.scale = 1.1;
  add(map, scaled);
  EXPECT_THROW(g2o_text(map), Error);
}

TEST(G2oText, of_an_empty_map_is_a_comment) { EXPECT_EQ(g2o_text(Map{}), "# 0 vertices, 0 constraints\n"); }

TEST(G2oText, of_a_camera_map_has_an_edge_for_each_sighting) {
  auto camera = std::make_shared<CameraGeometry>();
  camera->width = 640;
  camera->height = 480;
  camera->fx = camera->fy = 500.0;
  camera->cx = 320.0;
  camera->cy = 240.0;
  camera->baseline_m = 0.2;
  camera->robot_from_camera.t = {0.25, 0.0, 0.5};
  const auto keyframe = std::make_shared<const Payload>(KeyframeFeatures{camera, {}, {}});
  Map map;
  for (std::uint32_t i = 0; i < 2; ++i)
    add_pose(map, node_id("alpha", i), i + 1, {{1.0 * i, 0.0, 0.0}, {1, 0, 0, 0}}, keyframe);
  Landmark landmark;
  landmark.id = {node_id("alpha", 0).session, 0};
  landmark.anchor = node_id("alpha", 0);
  landmark.point_units = landmark_units({4.0, 0.5, 0.25});
  landmark.seen = {{node_id("alpha", 0), pixel_units(100.5), pixel_units(200.0), inverse_depth_units(4.0), 1},
                   {node_id("alpha", 1), pixel_units(90.0), pixel_units(200.0), 0, 0}};
  map.landmarks.set(landmark.id, landmark);
  Landmark once = landmark;
  once.id.index = 1;
  once.seen.pop_back();  // nothing holds it
  map.landmarks.set(once.id, once);
  const std::string text = g2o_text(map);
  EXPECT_THAT(text, HasSubstr("PARAMS_CAMERACALIB 0 0.25 0 0.5 0 0 0 1 500 500 320 240\n"));
  EXPECT_THAT(text, HasSubstr("VERTEX_SE3:QUAT 1 1 0 0 0 0 0 1\n"));
  EXPECT_THAT(text, HasSubstr("VERTEX_TRACKXYZ 2 4 0.5 0.25\n"
                              "EDGE_PROJECT_DISPARITY 0 2 0 100.5 200 0.25 1 0 0 1 0 10000\n"
                              "EDGE_PROJECT_DISPARITY 1 2 0 90 200 0 4 0 0 4 0 0\n"));
  EXPECT_THAT(text, testing::Not(HasSubstr("VERTEX_TRACKXYZ 3")));
}

}  // namespace
}  // namespace mapweave::exporters
