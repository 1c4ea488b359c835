#include "messages.h"

#include <mapweave/core/error.h>
#include <mapweave/maps/exchange.h>

#include <gmock/gmock.h>
#include <random>

namespace mapweave {
namespace {

using test::global_share;
using test::kAlphaCamera;
using test::sensed;
using test::share;
using test::small_scan;

TEST(Exchange, gives_a_share_back_to_what_its_form_holds) {
  const Share sent = share();
  const std::string bytes = encode(sent);
  const Share got = decode_share(bytes, "test");
  EXPECT_EQ(encode(got), bytes);
  EXPECT_EQ(got.map, sent.map);
  EXPECT_EQ(got.scale, sent.scale);
  ASSERT_EQ(got.corrected.size(), 1U);
  EXPECT_EQ(got.corrected[0].map_from_node.t, sent.corrected[0].map_from_node.t);
  ASSERT_EQ(got.landmarks.size(), sent.landmarks.size());
  for (std::size_t i = 0; i < got.landmarks.size(); ++i) {
    const DescribedLandmark &one = got.landmarks[i], &other = sent.landmarks[i];
    EXPECT_EQ(one.id, other.id);
    EXPECT_EQ(one.descriptor, other.descriptor);
    EXPECT_LT((one.point_in_map - other.point_in_map).norm(), 1e-4);
    EXPECT_LT((one.feature_from_point - other.feature_from_point).norm(), 1e-4);
    EXPECT_LT((one.direction - other.direction).norm(), 0.02);
    EXPECT_NEAR(one.nearest_m, other.nearest_m, 0.031 * other.nearest_m);
    EXPECT_NEAR(one.farthest_m, other.farthest_m, 0.031 * other.farthest_m);
    EXPECT_NEAR(one.sigma_m, other.sigma_m, 0.031 * other.sigma_m);
  }
  EXPECT_LT(static_cast<double>(bytes.size()) / static_cast<double>(sent.landmarks.size()), 80.0) << "small";
}

TEST(Exchange, gives_keyframes_of_others_back_and_light_ones_are_small) {
  const Share sent = global_share();
  const std::string bytes = encode(sent);
  const Share got = decode_share(bytes, "test");
  EXPECT_EQ(encode(got), bytes);
  ASSERT_EQ(got.keyframes.size(), 2U);
  EXPECT_EQ(got.keyframes[0].id, sent.keyframes[0].id);
  EXPECT_EQ(got.keyframes[0].scale, 1.5);
  EXPECT_EQ(got.keyframes[0].map_from_camera.t, sent.keyframes[0].map_from_camera.t);
  ASSERT_TRUE(got.keyframes[0].features);
  EXPECT_EQ(got.keyframes[0].features->descriptors, sent.keyframes[0].features->descriptors);
  EXPECT_EQ(*got.keyframes[0].features->geometry, *sent.keyframes[0].features->geometry);
  EXPECT_EQ(got.keyframes[0].landmarks.size(), 10U);
  EXPECT_FALSE(got.keyframes[1].features);
  EXPECT_EQ(got.dropped, sent.dropped);
  EXPECT_EQ(got.number, sent.number);
  Share without = sent;
  without.keyframes.pop_back();
  EXPECT_LT(bytes.size() - encode(without).size(), 80U);
  ClientView view{MapId("beta.camera"), {5}, Pose3(), 0};
  const std::string silent = encode(view);
  view.room = 300;
  view.missed = 2;
  view.missed_after = 7;
  EXPECT_EQ(decode_client_view(encode(view), "test").room, 300U);
  EXPECT_EQ(decode_client_view(encode(view), "test").missed, 2U);
  EXPECT_EQ(decode_client_view(encode(view), "test").missed_after, 7U);
  EXPECT_EQ(decode_client_view(silent, "test").room, 0U);
}

TEST(Exchange, refuses_keyframes_of_others_that_are_none) {
  const auto refused = [](const Share& share) { EXPECT_THROW(decode_share(encode(share), "test"), Error); };
  Share twice = global_share();
  twice.keyframes[1].id = twice.keyframes[0].id;
  refused(twice);
  Share bad = global_share();
  bad.keyframes[0].scale = -1.0;
  EXPECT_THROW(encode(bad), ContractViolation);
  bad = global_share();
  bad.keyframes[0].map_from_camera.t.x() = std::nan("");
  EXPECT_THROW(encode(bad), ContractViolation);
  bad = global_share();
  bad.keyframes[0].features->points[0].u = 16 * 320;
  refused(bad);
  bad = global_share();
  bad.dropped.resize(kMostSharedKeyframes + 1, bad.dropped.front());
  EXPECT_THROW(encode(bad), ContractViolation);
}

TEST(Exchange, gives_the_other_messages_back) {
  const Hash vocabulary = Hasher().add("words").finish();
  const Hello hello = decode_hello(encode(Hello{kAlphaCamera, vocabulary}), "test");
  EXPECT_EQ(hello.session, kAlphaCamera);
  EXPECT_EQ(hello.vocabulary, vocabulary);

  const ClientView view = decode_client_view(
      encode(ClientView{MapId("beta.camera.1"), {-7}, {{1, 2, 3}, Eigen::Quaterniond::Identity()}, 9}), "test");
  EXPECT_EQ(view.map, MapId("beta.camera.1"));
  EXPECT_EQ(view.stamp.ns, -7);
  EXPECT_EQ(view.map_from_robot.t, Eigen::Vector3d(1, 2, 3));
  EXPECT_EQ(view.forgotten, 9U);

  auto geometry = std::make_shared<CameraGeometry>();
  geometry->width = 640;
  geometry->height = 480;
  geometry->fx = geometry->fy = 500.0;
  geometry->cx = 320.0;
  geometry->cy = 240.0;
  PlaceRequest request{{42}, {geometry, {{100, 200, 300, 2, 4}}, {{1, 2, 3, 4}}}};
  const PlaceRequest asked = decode_place_request(encode(request), "test");
  EXPECT_EQ(asked.stamp, request.stamp);
  EXPECT_EQ(*asked.features.geometry, *geometry);
  ASSERT_EQ(asked.features.points.size(), 1U);
  EXPECT_EQ(asked.features.points[0].inverse_depth, 300);
  EXPECT_EQ(asked.features.descriptors[0], request.features.descriptors[0]);

  PlaceAnswer answer{{42}, MapId("alpha.camera"), {{0, 1, 2}, Eigen::Quaterniond::Identity()}, share().landmarks};
  const PlaceAnswer decoded = decode_place_answer(encode(answer), "test");
  EXPECT_EQ(decoded.stamp, answer.stamp);
  EXPECT_EQ(decoded.map, answer.map);
  EXPECT_EQ(decoded.map_from_robot.t, answer.map_from_robot.t);
  EXPECT_EQ(decoded.landmarks.size(), answer.landmarks.size());
}

TEST(Exchange, refuses_what_it_is_not) {
  const std::string bytes = encode(share());
  EXPECT_THROW(decode_client_view(bytes, "test"), Error) << "another message";
  EXPECT_THROW(decode_share("", "test"), Error);
  std::string newer = bytes;
  newer[1] = 11;
  try {
    decode_share(newer, "test");
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kUnsupported);
  }
  Share nowhere = share();
  nowhere.map = MapId();
  EXPECT_THROW(encode(nowhere), ContractViolation);
  nowhere = share();
  nowhere.corrected[0].map_from_node.t.x() = std::nan("");
  EXPECT_THROW(encode(nowhere), ContractViolation);
}

TEST(Exchange, keeps_what_robots_sense) {
  const PackedScan scan = small_scan();
  const Sensed back = decode_sensed(encode(sensed(scan)), "test");
  EXPECT_EQ(back.robot, RobotId("alpha"));
  EXPECT_EQ(back.sequence, 7U);
  EXPECT_EQ(back.stamp.ns, 123456789);
  EXPECT_EQ(*std::get<PackedScan>(back.body).geometry, *scan.geometry);
  EXPECT_EQ(std::get<PackedScan>(back.body).ranges, scan.ranges);
  Pose3 pose;
  pose.t = {0.1234567890123, -2.0, 0.0};
  EXPECT_EQ(std::get<Pose3>(decode_sensed(encode(sensed(pose)), "test").body).t, pose.t);
  EXPECT_FALSE(std::get<StreamEnd>(decode_sensed(encode(sensed(StreamEnd{})), "test").body).trouble);
  const Error trouble(ErrorCode::kCorrupt, "a log that is cut off", "alpha.rawlog:12", "record it again");
  const auto end = std::get<StreamEnd>(decode_sensed(encode(sensed(StreamEnd{trouble})), "test").body);
  ASSERT_TRUE(end.trouble);
  EXPECT_EQ(end.trouble->code(), trouble.code());
  EXPECT_STREQ(end.trouble->what(), trouble.what());
}

TEST(Exchange, keeps_the_last_word_of_a_robot_and_what_it_lost) {
  StreamEnd end{Error(ErrorCode::kCorrupt, "cut short", "alpha.rawlog")};
  end.notes = {"odometry in millimetres?", "no scan in 3 s"};
  end.log = "/logs/alpha.rawlog";
  end.log_sha256 = hash_of_bytes("alpha");
  const auto back = std::get<StreamEnd>(decode_sensed(encode(sensed(end)), "test").body);
  ASSERT_TRUE(back.trouble);
  EXPECT_EQ(back.notes, end.notes);
  EXPECT_EQ(back.log, end.log);
  EXPECT_EQ(back.log_sha256, end.log_sha256);
  EXPECT_TRUE(std::holds_alternative<LostScan>(decode_sensed(encode(sensed(LostScan{})), "test").body));
  end.notes.resize(kMostNotes + 1);
  EXPECT_THROW(encode(sensed(end)), ContractViolation);
}

TEST(Exchange, keeps_parts_of_what_a_robot_mapped_on_board) {
  const std::string bytes("a map\0of bytes", 14);
  const auto back = std::get<MappedPart>(decode_sensed(encode(sensed(MappedPart{true, true, bytes})), "test").body);
  EXPECT_TRUE(back.is_report);
  EXPECT_TRUE(back.ends);
  EXPECT_EQ(back.bytes, bytes);
  const auto map = std::get<MappedPart>(decode_sensed(encode(sensed(MappedPart{})), "test").body);
  EXPECT_FALSE(map.is_report);
  EXPECT_FALSE(map.ends);
  EXPECT_THROW(encode(sensed(MappedPart{false, true, std::string(kMostPartBytes + 1, 'x')})), ContractViolation);
}

TEST(Exchange, keeps_how_a_scan_was_bent_and_costs_nothing_where_it_was_not) {
  const PackedScan plain = small_scan();
  PackedScan bent = plain;
  auto geometry = std::make_shared<ScanGeometry>(*plain.geometry);
  geometry->first_ray_s = 0.05;
  geometry->ray_step_s = -0.0125;
  bent.geometry = geometry;
  bent.motion = {500, -20, -1200};
  const auto back = std::get<PackedScan>(decode_sensed(encode(sensed(bent)), "test").body);
  EXPECT_EQ(*back.geometry, *bent.geometry);
  EXPECT_EQ(back.motion, bent.motion);
  EXPECT_EQ(encode(sensed(bent)).substr(0, 2), "\x08\x05");
  EXPECT_EQ(encode(sensed(plain)).substr(0, 2), "\x08\x03") << "older programs read what has no sweep";
  EXPECT_EQ(std::get<InertialYaw>(decode_sensed(encode(sensed(InertialYaw{-7.25})), "test").body).yaw_rad, -7.25);
  EXPECT_THROW(encode(sensed(InertialYaw{std::nan("")})), ContractViolation);
  bent.geometry = plain.geometry;
  EXPECT_THROW(encode(sensed(bent)), ContractViolation) << "a motion, and no time in which it bends";
  geometry = std::make_shared<ScanGeometry>(*geometry);
  geometry->first_ray_s = 11.0;
  bent.geometry = geometry;
  EXPECT_THROW(encode(sensed(bent)), ContractViolation);
}

// The bytes of a number, exchanged for those of another.
std::string exchanged(std::string bytes, double from, double to) {
  const std::string before(reinterpret_cast<const char*>(&from), sizeof from),
      after(reinterpret_cast<const char*>(&to), sizeof to);
  const auto at = bytes.find(before);
  EXPECT_NE(at, std::string::npos);
  return bytes.replace(at, before.size(), after);
}

TEST(Exchange, refuses_sweeps_and_motions_that_cannot_be) {
  PackedScan bent = small_scan();
  auto geometry = std::make_shared<ScanGeometry>(*bent.geometry);
  geometry->first_ray_s = 0.05;
  geometry->ray_step_s = -0.0125;
  bent.geometry = geometry;
  bent.motion.x_mm_s = 32000;
  const std::string bytes = encode(sensed(bent));
  for (const double absurd : {std::nan(""), HUGE_VAL, -HUGE_VAL, 10.5, -1e300}) {
    EXPECT_THROW(decode_sensed(exchanged(bytes, 0.05, absurd), "test"), Error) << absurd;
    EXPECT_THROW(decode_sensed(exchanged(bytes, -0.0125, absurd), "test"), Error) << absurd;
  }
  EXPECT_THROW(decode_sensed(exchanged(exchanged(bytes, 0.05, 0.0), -0.0125, 0.0), "test"), Error)
      << "a motion without a sweep";
  std::string fast = bytes;
  const auto at = fast.find("\x18\x80\xF4\x03");  // 32 m/s
  ASSERT_NE(at, std::string::npos);
  fast.replace(at, 4, "\x18\xFF\xFF\x7F");  // 1049 m/s
  EXPECT_THROW(decode_sensed(fast, "test"), Error);
  EXPECT_THROW(decode_sensed(exchanged(encode(sensed(InertialYaw{-7.25})), -7.25, std::nan("")), "test"), Error);
}

TEST(Exchange, refuses_to_sense_what_cannot_be) {
  PackedScan scan = small_scan();
  scan.ranges.pop_back();
  EXPECT_THROW(encode(sensed(scan)), ContractViolation);
  Pose3 nowhere;
  nowhere.t.x() = std::nan("");
  EXPECT_THROW(encode(sensed(nowhere)), ContractViolation);
  EXPECT_THROW(decode_sensed(encode(share()), "test"), Error);
  std::mt19937_64 random(18);
  StreamEnd end;
  end.notes = {"a note"};
  end.log = "alpha.rawlog";
  const std::string scan_bytes = encode(sensed(small_scan())), end_bytes = encode(sensed(end));
  for (int i = 0; i < 6000; ++i) {
    std::string damaged = i % 2 == 0 ? scan_bytes : end_bytes;
    damaged[random() % damaged.size()] ^= static_cast<char>(1 << (random() % 8));
    if (i % 5 == 0) damaged.resize(random() % damaged.size());
    try {
      const Sensed got = decode_sensed(damaged, "test");
      EXPECT_NO_THROW(encode(got)) << "what was read is sound";
    } catch (const Error&) {}
  }
}

void expect_survives(const std::string& bytes) {
  std::mt19937_64 random(17);
  for (int i = 0; i < 3000; ++i) {
    std::string damaged = bytes;
    for (int flip = 0; flip < 1 + i % 3; ++flip)
      damaged[random() % damaged.size()] ^= static_cast<char>(1 << (random() % 8));
    if (i % 5 == 0) damaged.resize(random() % damaged.size());
    try {
      const Share got = decode_share(damaged, "test");
      EXPECT_NO_THROW(encode(got)) << "what was read is sound";
    } catch (const Error&) {}
  }
}

TEST(Exchange, survives_bytes_that_are_flipped) {
  for (const std::string& bytes : {encode(share()), encode(global_share())}) expect_survives(bytes);
}

}  // namespace
}  // namespace mapweave
