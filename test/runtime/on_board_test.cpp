// What a robot that maps on board says to its edge: parts of maps, and reports on cameras.
#include "robot_records.h"

#include <live/on_board.h>
#include <mapweave/tiers/edge_server.h>

#include <gmock/gmock.h>
#include <nlohmann/json.hpp>

namespace mapweave::runtime {
namespace {

using nlohmann::json;
using testing::HasSubstr;

using test::kAlpha;
using test::path;
using test::record_of_cameras;
using test::turned;

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
