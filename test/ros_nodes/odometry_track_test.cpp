// Odometry at a time, and how it lies in a map.
#include <gmock/gmock.h>
#include <odometry_track.h>
#include <ros_messages.h>

#include <limits>

namespace mapweave::ros_nodes {
namespace {

Pose3 pose(double x, double y, double phi = 0.0) { return spatial(Pose2(x, y, phi)); }
Stamp at_s(double seconds) { return stamp_from_seconds(1000.0 + seconds); }

nav_msgs::Odometry odometry(double seconds, const Pose3& odometry_from_robot, const std::string& frame = "odom") {
  nav_msgs::Odometry message;
  message.header.stamp = ros_time(at_s(seconds));
  message.header.frame_id = frame;
  message.child_frame_id = "base";
  message.pose.pose = pose_message(odometry_from_robot);
  return message;
}

double x_at(const OdometryTrack& track, double seconds) {
  const auto found = track.at(at_s(seconds));
  return found ? found->odometry_from_robot.t.x() : std::numeric_limits<double>::quiet_NaN();
}

TEST(OdometryTrack, interpolates_between_messages_and_nowhere_else) {
  OdometryTrack track(600.0, 1.0);
  EXPECT_FALSE(track.frames());
  track.add(odometry(0.0, pose(0, 0), "/odom"));
  track.add(odometry(0.5, pose(1, 0), "/odom"));
  track.add(odometry(3.0, pose(2, 0), "/odom"));
  EXPECT_NEAR(x_at(track, 0.25), 0.5, 1e-6);
  EXPECT_NEAR(x_at(track, 3.0), 2.0, 1e-9);
  EXPECT_FALSE(track.at(at_s(-0.1)));
  EXPECT_FALSE(track.at(at_s(3.1)));
  EXPECT_FALSE(track.at(at_s(1.5))) << "in a gap";
  EXPECT_EQ(track.at(at_s(0.25))->frame, "odom") << "tf2 has no slash before a frame";
  EXPECT_EQ(track.frames()->robot_frame, "base");
}

TEST(OdometryTrack, begins_anew_where_time_goes_back_or_the_frame_changes) {
  OdometryTrack track;
  track.add(odometry(10.0, pose(1, 0)));
  track.add(odometry(10.5, pose(2, 0)));
  track.add(odometry(2.0, pose(7, 0)));
  EXPECT_FALSE(track.at(at_s(10.2)));
  EXPECT_EQ(x_at(track, 2.0), 7.0);
  track.add(odometry(2.5, pose(8, 0), "other"));
  EXPECT_FALSE(track.at(at_s(2.0)));
  EXPECT_EQ(track.at(at_s(2.5))->frame, "other");
}

TEST(OdometryTrack, leaves_out_what_is_no_pose) {
  OdometryTrack track;
  nav_msgs::Odometry broken = odometry(0.0, pose(1, 0));
  broken.pose.pose.position.x = std::numeric_limits<double>::infinity();
  track.add(broken);
  nav_msgs::Odometry unturned = odometry(0.0, pose(1, 0));
  unturned.pose.pose.orientation.w = 0.0;
  track.add(unturned);
  track.add(odometry(0.0, pose(1, 0), ""));
  EXPECT_FALSE(track.frames());
}

TEST(OdometryTrack, forgets_what_is_old) {
  OdometryTrack track(10.0, 1.0);
  for (int i = 0; i <= 300; ++i) track.add(odometry(0.1 * i, pose(i, 0)));
  EXPECT_FALSE(track.at(at_s(5.0)));
  EXPECT_NEAR(x_at(track, 20.0), 200.0, 1e-3);
  EXPECT_NEAR(x_at(track, 30.0), 300.0, 1e-3);
}

TEST(OdometryCorrection, puts_the_newest_node_where_the_map_has_it) {
  OdometryTrack track;
  for (int i = 0; i <= 20; ++i) track.add(odometry(0.5 * i, pose(0.5 * i, 0, 0.1)));
  OdometryCorrection correction;
  const auto look = [&](Stamp stamp) { return track.at(stamp); };
  EXPECT_FALSE(correction.update({}, look));
  std::vector<StampedPose> trajectory = {{at_s(1.0), pose(0, 0)}, {at_s(4.25), pose(3, 1, 1.5)}};
  const auto found = correction.update(trajectory, look);
  ASSERT_TRUE(found);
  EXPECT_EQ(found->odometry_frame, "odom");
  const Pose3 base = compose(found->map_from_odometry, track.at(at_s(4.25))->odometry_from_robot);
  EXPECT_LT((base.t - trajectory.back().map_from_robot.t).norm(), 1e-9);
  EXPECT_LT(base.q.angularDistance(trajectory.back().map_from_robot.q), 1e-9);
}

TEST(OdometryCorrection, goes_on_from_the_node_that_was_known_last) {
  OdometryCorrection correction;
  const auto known = [&](Stamp stamp) {
    return stamp == at_s(1.0) ? std::optional(OdometryPose{"odom", "base", pose(10, 0)}) : std::nullopt;
  };
  EXPECT_FALSE(correction.update({{at_s(0.0), pose(0, 0)}}, known));
  ASSERT_TRUE(correction.update({{at_s(0.0), pose(0, 0)}, {at_s(1.0), pose(1, 0)}}, known));
  // A loop moved that node, and the newest one's odometry did not come.
  const auto later =
      correction.update({{at_s(0.0), pose(0, 0)}, {at_s(1.0), pose(1, 2)}, {at_s(9.0), pose(5, 5)}}, known);
  ASSERT_TRUE(later);
  EXPECT_LT((later->map_from_odometry.t - Eigen::Vector3d(-9, 2, 0)).norm(), 1e-9);
  EXPECT_FALSE(correction.update({{at_s(500.0), pose(0, 0)}}, known)) << "of another recording";
}

}  // namespace
}  // namespace mapweave::ros_nodes
