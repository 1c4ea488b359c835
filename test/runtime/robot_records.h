#pragma once
// What a robot's cameras left, for tests.

#include <live/robot_record.h>

namespace mapweave::runtime::test {

const RobotId kAlpha("alpha");

inline Pose3 turned(double x) {
  Pose3 pose;
  pose.t = {x, 0.1, -0.2};
  pose.q = Eigen::Quaterniond(Eigen::AngleAxisd(0.3 * x, Eigen::Vector3d::UnitZ()));
  return pose;
}

inline std::vector<StampedPose> path(int count) {
  std::vector<StampedPose> poses;
  for (int i = 0; i < count; ++i) poses.push_back({{1'305'031'239'123'456'000 + i}, turned(0.1 * i)});
  return poses;
}

inline RobotRecord record_of_cameras() {
  RobotRecord record;
  record.robot = kAlpha;
  record.sensor = "camera";
  record.trouble = Error(ErrorCode::kCorrupt, "cut short", "alpha.rawlog", "record it again");
  CamerasOutcome cameras;
  CameraResult& camera = cameras.cameras.emplace_back();
  camera.chosen = {"front", sensor_kind("rgbd")};
  camera.report.label = "front";
  camera.report.kind = "rgbd";
  camera.report.frames = 435;
  camera.report.landmarks = 1489;
  camera.report.longest_loss_s = 0.1;
  camera.report.readout_s = 1.0 / 3.0;
  camera.report.loops = {{1.5, 2.25}};
  camera.report.traffic = {{3, 100, 7}};
  camera.notes = {"its pictures are dark"};
  exporters::SheetFrame& frame = camera.sheet.emplace_back();
  frame.width = 3;
  frame.height = 2;
  frame.grey = {0, 1, 128, 200, 254, 255};
  frame.caption = "at 3.2 s";
  frame.tracks = {{{{0.5F, 1.25F}, {0.1F, 0.2F}}, 2.5F}};
  CameraMap& map = cameras.maps.emplace_back();
  map.map.id = MapId("alpha");
  map.trajectories = {{"front", path(3), turned(1.0)}};
  map.rig = {{"front", "back"}, 4, 0.5, 0.25, true};
  cameras.notes = {"its cameras left one map"};
  cameras.doubts = {"odometry in millimetres?"};
  cameras.odometry = path(2);
  cameras.wheels = path(4);
  cameras.live.emplace_back();
  cameras.live.back().sensor = {"front", false, true, turned(2.0)};
  cameras.live.back().poses = {{{7}, 0, turned(0.5)}, {{9}, 1, turned(0.6)}};
  cameras.log_seconds = 15.0;
  cameras.cpu_seconds = 3.5;
  record.cameras = std::move(cameras);
  return record;
}

}  // namespace mapweave::runtime::test
