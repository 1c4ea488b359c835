#include <gmock/gmock.h>
#include <mapweave/laser/mapper_protocol.h>

#include <functional>
#include <limits>

namespace mapweave::laser::protocol {
namespace {

using ::testing::HasSubstr;

MapperFrame only_frame(std::string_view bytes) {
  FrameParser parser;
  parser.feed(bytes);
  const auto frame = parser.next();
  if (!frame || parser.next()) throw std::runtime_error("not one frame");
  return *frame;
}

std::string message_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kCorrupt);
    return error.what();
  }
  return "no error";
}

ScanGeometry some_geometry() {
  ScanGeometry geometry;
  geometry.first_angle_rad = -1.5;
  geometry.angle_step_rad = 0.01;
  geometry.ray_count = 3;
  geometry.max_range_m = 50.0;
  geometry.robot_from_laser.t = {0.1, 0.2, 0.3};
  geometry.robot_from_laser.q = Eigen::Quaterniond(Eigen::AngleAxisd(0.3, Eigen::Vector3d::UnitZ()));
  return geometry;
}

TEST(MapperProtocol, carries_every_option) {
  RbpfOptions options;
  options.seed = 4294967295u;
  options.particles = 3;
  options.correct_odometry = false;
  options.icp.shrink = 0.25;
  options.grid.ray_decimation = 9;
  const auto back = std::get<RbpfOptions>(decode_start(only_frame(encode_start(options)).body));
  EXPECT_EQ(back.seed, 4294967295u);
  EXPECT_EQ(back.particles, 3);
  EXPECT_FALSE(back.correct_odometry);
  EXPECT_EQ(back.icp.shrink, 0.25);
  EXPECT_EQ(back.grid.ray_decimation, 9);
  EXPECT_EQ(encode_start(back), encode_start(options));
  EXPECT_TRUE(std::holds_alternative<IcpOptions>(decode_start(only_frame(encode_start(IcpOptions{})).body)));
}

TEST(MapperProtocol, carries_scans_odometry_and_poses) {
  const auto geometry = std::make_shared<const ScanGeometry>(decode_geometry(only_frame(encode(some_geometry())).body));
  EXPECT_TRUE(*geometry == some_geometry());
  const auto scan = decode_scan(only_frame(encode_scan(Stamp{-5}, {geometry, {0, 1, 65535}})).body, geometry);
  EXPECT_EQ(scan.stamp.ns, -5);
  EXPECT_EQ(scan.scan.ranges, (std::vector<std::uint16_t>{0, 1, 65535}));
  const auto odometry = decode_odometry(only_frame(encode_odometry(Stamp{7}, {1.0, -2.0, 3.0})).body);
  EXPECT_EQ(odometry.stamp.ns, 7);
  EXPECT_EQ(odometry.odometry_from_robot.y, -2.0);
  std::vector<ScanPose> poses(kPosesPerFrame + 1);
  poses.back() = {{1, 2, 3}, {4, 5, 6}, true};
  FrameParser parser;
  parser.feed(encode_poses(poses));
  std::vector<ScanPose> back;
  while (const auto frame = parser.next())
    for (const auto& pose : decode_poses(frame->body)) back.push_back(pose);
  ASSERT_EQ(back.size(), poses.size());
  EXPECT_EQ(back.back().previous_from_this.phi, 6.0);
  EXPECT_TRUE(back.back().by_wheels);
}

TEST(MapperProtocol, finds_frames_however_the_stream_is_cut) {
  const std::string bytes = encode_odometry(Stamp{1}, {}) + framed(Kind::end) + encode_count(Kind::done, 9);
  for (std::size_t cut = 1; cut < bytes.size(); ++cut) {
    FrameParser parser;
    std::vector<Kind> kinds;
    for (std::size_t begin = 0; begin < bytes.size(); begin += cut) {
      parser.feed(std::string_view(bytes).substr(begin, cut));
      while (const auto frame = parser.next()) kinds.push_back(frame->kind);
    }
    EXPECT_EQ(kinds, (std::vector<Kind>{Kind::odometry, Kind::end, Kind::done})) << cut;
  }
}

TEST(MapperProtocol, refuses_sizes_that_cannot_be) {
  for (const std::uint32_t length : {0u, kMaxFrameBytes + 1, 0xffffffffu}) {
    FrameParser parser;
    parser.feed(Writer().add(length).bytes());
    EXPECT_THAT(message_of([&] { parser.next(); }), HasSubstr("a frame of " + std::to_string(length) + " bytes"));
  }
}

TEST(MapperProtocol, refuses_strangers_and_other_versions) {
  std::string body = only_frame(encode_start(RbpfOptions{})).body;
  EXPECT_THAT(message_of([&] { decode_start("GET / HTTP/1.1"); }), HasSubstr("does not begin with MWMM"));
  body[4] = 3;
  EXPECT_THAT(message_of([&] { decode_start(body); }), HasSubstr("protocol version 3; this mrpt_mapper speaks 2"));
  body[4] = 2;
  body[5] = 7;
  EXPECT_THAT(message_of([&] { decode_start(body); }), HasSubstr("engine 7"));
}

TEST(MapperProtocol, refuses_every_frame_that_is_cut_or_too_long) {
  const auto geometry = std::make_shared<const ScanGeometry>(some_geometry());
  const std::vector<std::pair<std::string, std::function<void(std::string_view)>>> decoders{
      {encode_start(RbpfOptions{}), [](std::string_view body) { decode_start(body); }},
      {encode(*geometry), [](std::string_view body) { decode_geometry(body); }},
      {encode_scan(Stamp{1}, {geometry, {1, 2, 3}}), [&](std::string_view body) { decode_scan(body, geometry); }},
      {encode_odometry(Stamp{1}, {}), [](std::string_view body) { decode_odometry(body); }},
      {encode_count(Kind::done, 1), [](std::string_view body) { decode_count(body); }}};
  for (const auto& [bytes, decode] : decoders) {
    const std::string body = only_frame(bytes).body;
    EXPECT_NO_THROW(decode(body));
    for (std::size_t size = 0; size < body.size(); ++size)
      EXPECT_THROW(decode(std::string_view(body).substr(0, size)), Error) << size;
    EXPECT_THROW(decode(body + "x"), Error);
  }
  const std::string poses = only_frame(encode_poses({{}})).body;
  EXPECT_THROW(decode_poses(std::string_view(poses).substr(1)), Error);
}

TEST(MapperProtocol, refuses_numbers_that_are_none_and_lasers_that_cannot_be) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THAT(message_of([&] {
                decode_odometry(only_frame(encode_odometry(Stamp{1}, {nan, 0, 0})).body);
              }),
              HasSubstr("not finite"));
  const auto refused = [](auto change) {
    ScanGeometry geometry = some_geometry();
    change(geometry);
    return message_of([&] { decode_geometry(only_frame(encode(geometry)).body); });
  };
  EXPECT_THAT(refused([](auto& g) { g.ray_count = 0xffffffff; }), HasSubstr("4294967295 rays"));
  EXPECT_THAT(refused([](auto& g) { g.ray_count = 1; }), HasSubstr("1 rays"));
  EXPECT_THAT(refused([](auto& g) { g.angle_step_rad = 100.0; }), HasSubstr("two turns"));
  EXPECT_THAT(refused([](auto& g) { g.range_unit_m = 0.0; }), HasSubstr("unit"));
  EXPECT_THAT(refused([](auto& g) { g.robot_from_laser.q.coeffs() *= 2.0; }), HasSubstr("unit quaternion"));
  EXPECT_THAT(message_of([&] { decode_scan("", nullptr); }), HasSubstr("before any geometry"));
  RbpfOptions options;
  options.particles = 1'000'000;
  EXPECT_THAT(message_of([&] { decode_start(only_frame(encode_start(options)).body); }),
              HasSubstr("particles is 1000000"));
}

}  // namespace
}  // namespace mapweave::laser::protocol
