// What a robot that maps on board says to its edge: parts of maps, and reports on cameras.
#include <live/on_board.h>
#include <mapweave/tiers/edge_server.h>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

namespace mapweave::runtime {
namespace {

using nlohmann::json;
using testing::HasSubstr;

const RobotId kAlpha("alpha");

Pose3 turned(double x) {
  Pose3 pose;
  pose.t = {x, 0.1, -0.2};
  pose.q = Eigen::Quaterniond(Eigen::AngleAxisd(0.3 * x, Eigen::Vector3d::UnitZ()));
  return pose;
}

std::vector<StampedPose> path(int count) {
  std::vector<StampedPose> poses;
  for (int i = 0; i < count; ++i) poses.push_back({{1'305'031'239'123'456'000 + i}, turned(0.1 * i)});
  return poses;
}

RobotRecord record_of_cameras() {
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

std::string message_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    return error.what();
  }
  return "no error";
}

TEST(RobotRecord, keeps_all_that_cameras_left) {
  const std::string bytes = encode(record_of_cameras());
  const RobotRecord back = decode_robot_record(bytes, "test");
  EXPECT_EQ(encode(back), bytes);
  ASSERT_TRUE(back.cameras);
  const CamerasOutcome& cameras = *back.cameras;
  ASSERT_EQ(cameras.cameras.size(), 1U);
  EXPECT_EQ(cameras.cameras[0].chosen.kind, sensor_kind("rgbd"));
  EXPECT_EQ(cameras.cameras[0].report.readout_s, 1.0 / 3.0);
  EXPECT_EQ(cameras.cameras[0].sheet[0].grey, record_of_cameras().cameras->cameras[0].sheet[0].grey);
  EXPECT_EQ(cameras.cameras[0].sheet[0].tracks[0].pixels[1].first, 0.1F);
  EXPECT_EQ(cameras.maps[0].trajectories[0].frames.back().stamp, path(3).back().stamp);
  EXPECT_EQ(cameras.live[0].poses[1].session, 1);
  EXPECT_TRUE(cameras.maps[0].rig.optimised);
}

// A robot whose laser left a map and whose cameras saw nothing.
TEST(RobotRecord, keeps_what_is_wrong_with_cameras_apart_from_the_laser) {
  RobotRecord record = record_of_cameras();
  record.trouble.reset();
  record.has_laser_map = true;
  record.camera_trouble = Error(ErrorCode::kBadInput, "nothing was tracked", "alpha.rawlog");
  record.cameras->maps.clear();
  const std::string bytes = encode(record);
  RobotRecord back = decode_robot_record(bytes, "test");
  EXPECT_EQ(encode(back), bytes);
  PlannedRobot robot;
  robot.id = kAlpha;
  Map map;
  map.id = MapId("alpha");
  const RobotResult result = result_of(std::move(back), {map}, robot, {});
  EXPECT_FALSE(result.outcome.trouble) << "it is mapped by its laser alone";
  ASSERT_TRUE(result.outcome.map);
  EXPECT_EQ(result.outcome.map->id, map.id);
  EXPECT_TRUE(result.cameras.trouble);
  json broken = json::parse(bytes);
  broken["has_laser_map"] = "yes";
  EXPECT_THAT(message_of([&] { decode_robot_record(broken.dump(), "robot alpha"); }), HasSubstr("true or false"));
}

TEST(RobotRecord, refuses_what_no_cameras_left) {
  const json whole = json::parse(encode(record_of_cameras()));
  const auto refusal = [&](const std::string& place, const json& value) {
    json broken = whole;
    broken[json::json_pointer("/cameras" + place)] = value;
    return message_of([&] { decode_robot_record(broken.dump(), "robot alpha"); });
  };
  EXPECT_THAT(refusal("", 3), HasSubstr("an object was expected"));
  EXPECT_THAT(refusal("/cameras/0/chosen/kind", "laser"), HasSubstr("no kind of camera"));
  EXPECT_THAT(refusal("/cameras/0/sheet/0/grey", "0001"), HasSubstr("lacks pixels"));
  EXPECT_THAT(refusal("/cameras/0/sheet/0/grey", "00018xc8feff"), HasSubstr("a picture that is none"));
  EXPECT_THAT(refusal("/cameras/0/sheet/0/width", 1e9), HasSubstr("width"));
  EXPECT_THAT(refusal("/cameras/0/report/frames", -1), HasSubstr("a count is not negative"));
  EXPECT_THAT(refusal("/cameras/0/report/traffic/0", {1, 2}), HasSubstr("a list of 3"));
  EXPECT_THAT(refusal("/maps/0/id", "../up"), HasSubstr("id"));
  EXPECT_THAT(refusal("/maps/0/trajectories", json::array()), HasSubstr("a map of no camera"));
  EXPECT_THAT(refusal("/live/0/poses/0/2", {0, 0, 0, 0, 0, 0, 2}), HasSubstr("a rotation that is none"));
  EXPECT_THAT(refusal("/live/0/poses/1/0", 3), HasSubstr("stamps run backwards"));
  EXPECT_THAT(refusal("/odometry", "none"), HasSubstr("a list was expected"));
  for (auto it = whole["cameras"].begin(); it != whole["cameras"].end(); ++it) {
    json broken = whole;
    broken["cameras"].erase(it.key());
    EXPECT_THAT(message_of([&] { decode_robot_record(broken.dump(), "robot alpha"); }), HasSubstr(it.key()));
  }
}

TEST(OnBoardParts, are_put_together_and_checked) {
  Map map;
  map.id = MapId("alpha");
  const std::string update = tiers::first_update(map, TierId("north")), report = encode(record_of_cameras());
  OnBoardParts parts;
  const std::size_t half = report.size() / 2;
  parts.add({false, true, update}, kAlpha);
  parts.add({true, false, report.substr(0, half)}, kAlpha);
  EXPECT_FALSE(parts.record);
  parts.add({true, true, report.substr(half)}, kAlpha);
  ASSERT_TRUE(parts.record);
  EXPECT_EQ(encode(*parts.record), report);
  ASSERT_EQ(parts.maps.size(), 1U);
  EXPECT_EQ(parts.maps.front().id, map.id);
  EXPECT_THAT(message_of([&] { parts.add({false, true, update}, kAlpha); }), HasSubstr("'alpha.1' was due"));
  EXPECT_THAT(message_of([&] { parts.add({true, true, report}, RobotId("beta")); }), HasSubstr("robot 'alpha'"));
  EXPECT_NE(message_of([&] { parts.add({false, true, "no map"}, kAlpha); }), "no error");
  EXPECT_NE(message_of([&] { parts.add({true, true, "{"}, kAlpha); }), "no error");
}

}  // namespace
}  // namespace mapweave::runtime
