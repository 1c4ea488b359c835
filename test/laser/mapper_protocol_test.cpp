#include <gmock/gmock.h>
#include <mapweave/laser/mapper_protocol.h>

#include <functional>
#include <limits>

namespace mapweave::laser::protocol {
namespace {

using ::testing::HasSubstr;

std::string message_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kCorrupt);
    return error.what();
  }
  return "no error";
}

EngineStart sent(const EngineStart& start) { return std::get<EngineStart>(decode_mapper_input(encode(start), "test")); }

TEST(MapperProtocol, carries_every_option) {
  RbpfOptions options;
  options.seed = 4294967295u;
  options.particles = 3;
  options.correct_odometry = false;
  options.match_yaw_rad = 0.1;
  options.icp.shrink = 0.25;
  options.grid.ray_decimation = 9;
  const EngineStart start = start_of(options);
  const auto back = std::get<RbpfOptions>(options_of(sent(start)));
  EXPECT_EQ(back.seed, 4294967295u);
  EXPECT_EQ(back.particles, 3);
  EXPECT_FALSE(back.correct_odometry);
  EXPECT_EQ(back.match_yaw_rad, 0.1);
  EXPECT_EQ(back.icp.shrink, 0.25);
  EXPECT_EQ(back.grid.ray_decimation, 9);
  EXPECT_EQ(encode(start_of(back)), encode(start));
  EXPECT_TRUE(std::holds_alternative<IcpOptions>(options_of(sent(start_of(IcpOptions{})))));
}

TEST(MapperProtocol, refuses_options_that_are_not_its_own) {
  const auto refused = [](auto change) {
    EngineStart start = start_of(RbpfOptions{});
    change(start);
    return message_of([&] { options_of(start); });
  };
  EXPECT_THAT(refused([](EngineStart& start) { start.engine = "gmapping"; }), HasSubstr("'gmapping' is unknown"));
  EXPECT_THAT(refused([](EngineStart& start) { start.options.pop_back(); }), HasSubstr("ray_decimation"));
  EXPECT_THAT(refused([](EngineStart& start) { start.options.push_back({"more", 1.0}); }), HasSubstr("does not know"));
  EXPECT_THAT(refused([](EngineStart& start) { std::swap(start.options[1], start.options[2]); }),
              HasSubstr("particles is not where"));
  EXPECT_THAT(refused([](EngineStart& start) { start.options[1].value = 1e6; }), HasSubstr("particles is 1000000"));
  EXPECT_THAT(refused([](EngineStart& start) { start.options[1].value = 2.5; }), HasSubstr("no whole number"));
}

TEST(MapperProtocol, sends_poses_in_as_many_frames_as_it_takes) {
  for (const std::size_t count : {std::size_t{0}, std::size_t{1}, kPosesPerFrame, kPosesPerFrame + 1}) {
    std::vector<ScanPose> poses(count);
    if (count > 0) poses.back() = {{1, 2, 3}, {4, 5, 6}, true};
    FrameParser parser;
    parser.feed(frames_of(poses));
    std::vector<ScanPose> back;
    bool is_last = false;
    while (const auto frame = parser.next()) {
      EXPECT_FALSE(is_last);
      const auto some = std::get<ScanPoses>(decode_mapper_output(*frame, "test"));
      back.insert(back.end(), some.poses.begin(), some.poses.end());
      is_last = some.is_last;
    }
    EXPECT_TRUE(is_last);
    ASSERT_EQ(back.size(), poses.size());
    if (count == 0) continue;
    EXPECT_EQ(back.back().previous_from_this.phi, 6.0);
    EXPECT_TRUE(back.back().by_wheels);
  }
}

TEST(MapperProtocol, finds_frames_however_the_stream_is_cut) {
  const std::string bytes =
      framed(MapperProgress{7}) + framed(Refusal{Error(ErrorCode::kInternal, "no")}) + framed(MapperProgress{9});
  for (std::size_t cut = 1; cut < bytes.size(); ++cut) {
    FrameParser parser;
    std::vector<std::size_t> kinds;
    for (std::size_t begin = 0; begin < bytes.size(); begin += cut) {
      parser.feed(std::string_view(bytes).substr(begin, cut));
      while (const auto frame = parser.next()) kinds.push_back(decode_mapper_output(*frame, "test").index());
    }
    EXPECT_EQ(kinds, (std::vector<std::size_t>{0, 2, 0})) << cut;
  }
}

TEST(MapperProtocol, refuses_sizes_that_cannot_be) {
  for (const std::uint32_t length : {0u, kMaxFrameBytes + 1, 0xffffffffu}) {
    std::string bytes;
    for (int i = 0; i < 4; ++i) bytes.push_back(static_cast<char>(length >> (8 * i) & 0xff));
    FrameParser parser;
    parser.feed(bytes);
    EXPECT_THAT(message_of([&] { parser.next(); }), HasSubstr("a frame of " + std::to_string(length) + " bytes"));
  }
}

TEST(MapperProtocol, refuses_strangers) {
  EXPECT_THAT(message_of([] { decode_mapper_input("GET / HTTP/1.1", kStream); }), HasSubstr(kStream));
  EXPECT_THAT(message_of([] { decode_mapper_input(encode(MapperProgress{1}), kStream); }), HasSubstr("for a helper"));
  EXPECT_THAT(message_of([] {
                decode_mapper_output(encode(EngineStart{"icp", {}}), kStream);
              }),
              HasSubstr("of a helper"));
}

TEST(MapperProtocol, refuses_lasers_that_cannot_be) {
  const auto refused = [](auto change) {
    ScanGeometry geometry;
    geometry.angle_step_rad = 0.01;
    geometry.ray_count = 3;
    EXPECT_NO_THROW(expect_usable(geometry));
    change(geometry);
    return message_of([&] { expect_usable(geometry); });
  };
  EXPECT_THAT(refused([](auto& g) { g.ray_count = 0xffffffff; }), HasSubstr("4294967295 rays"));
  EXPECT_THAT(refused([](auto& g) { g.ray_count = 1; }), HasSubstr("1 rays"));
  EXPECT_THAT(refused([](auto& g) { g.angle_step_rad = 100.0; }), HasSubstr("two turns"));
  EXPECT_THAT(refused([](auto& g) { g.range_unit_m = 2.0; }), HasSubstr("unit"));
}

}  // namespace
}  // namespace mapweave::laser::protocol
