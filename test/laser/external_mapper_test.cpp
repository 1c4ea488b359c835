#include <gmock/gmock.h>
#include <mapweave/core/error.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/laser/external_mapper.h>
#include <mapweave/maps/map_update.h>
#include <support/pose_matchers.h>
#include <support/temporary_folder.h>

#include <signal.h>
#include <sys/wait.h>
#include <unistd.h>

#include <chrono>
#include <filesystem>
#include <fstream>
#include <functional>
#include <thread>

#include "box_room.h"

namespace mapweave::laser {
namespace {

using mapweave::test::IsNear;
using mapweave::test::TemporaryFolder;
using test::drive_around;
using ::testing::AnyOf;
using ::testing::HasSubstr;
using ::testing::MatchesRegex;

const ClientId kAlpha{RobotId("alpha"), SensorId("laser")};

RbpfOptions few_particles() {
  RbpfOptions options;
  options.particles = 3;
  return options;
}

Map mapped(const test::Drive& drive, const std::variant<RbpfOptions, IcpOptions>& engine) {
  ExternalMapper mapper(kAlpha, engine);
  for (const LaserInput& input : drive.inputs) mapper.add(input);
  mapper.finish();
  return mapper.snapshot();
}

Error error_of(const std::function<void()>& action) {
  try {
    action();
  } catch (const Error& error) {
    return error;
  }
  return Error(ErrorCode::kInternal, "no error");
}

void expect_the_path_that_was_driven(const test::Drive& drive, const Map& map, double metres, double radians) {
  ASSERT_EQ(map.nodes.size(), drive.room_from_robot.size());
  std::size_t i = 0;
  for (const auto& [id, node] : map.nodes) {
    EXPECT_EQ(id.index, i);
    EXPECT_THAT(planar(node.map_from_node),
                IsNear(between(drive.room_from_robot.front(), drive.room_from_robot[i]), metres, radians))
        << "scan " << i;
    ++i;
  }
}

bool wait_until(const std::function<bool()>& condition) {
  for (int i = 0; i < 500; ++i) {
    if (condition()) return true;
    std::this_thread::sleep_for(std::chrono::milliseconds(10));
  }
  return false;
}

TEST(ExternalMapper, icp_follows_a_robot_whose_wheels_slip) {
  const auto drive = drive_around(260, true);
  const Map map = mapped(drive, IcpOptions{});
  expect_the_path_that_was_driven(drive, map, 0.06, 0.02);
  EXPECT_EQ(map.id, MapId("alpha"));
  EXPECT_EQ(map.sessions(), (std::vector<SessionId>{{kAlpha, 1'000'000'000'000'000'000}}));
  EXPECT_GE(map.submaps.size(), 3u);
  EXPECT_GT(map.constraints.size(), 500u);  // by matching and by wheels
}

TEST(ExternalMapper, rbpf_follows_a_robot_whose_wheels_slip) {
  const auto drive = drive_around(260, true);
  expect_the_path_that_was_driven(drive, mapped(drive, few_particles()), 0.08, 0.03);
}

TEST(ExternalMapper, both_engines_work_without_odometry) {
  const auto drive = drive_around(200, false);
  for (const std::variant<RbpfOptions, IcpOptions>& engine :
       {std::variant<RbpfOptions, IcpOptions>(IcpOptions{}), {few_particles()}}) {
    const Map map = mapped(drive, engine);
    expect_the_path_that_was_driven(drive, map, 0.12, 0.04);
    for (const auto& [id, constraint] : map.constraints) EXPECT_EQ(id.kind, ConstraintKind::scan_match);
  }
}

TEST(ExternalMapper, shows_its_map_while_it_grows_and_ends_with_the_same) {
  const auto drive = drive_around(260, true);
  for (const std::variant<RbpfOptions, IcpOptions>& engine :
       {std::variant<RbpfOptions, IcpOptions>(IcpOptions{}), {few_particles()}}) {
    ExternalMapper mapper(kAlpha, engine);
    EXPECT_TRUE(mapper.snapshot().empty());
    mapper.catch_up();
    EXPECT_TRUE(mapper.snapshot().empty()) << "nothing was added";
    std::size_t added = 0, before = 0;
    for (const LaserInput& input : drive.inputs) {
      mapper.add(input);
      added += std::holds_alternative<ScanInput>(input) ? 1 : 0;
      if (added % 100 != 0 || added == before) continue;
      before = added;
      mapper.catch_up();
      const Map map = mapper.snapshot();
      EXPECT_LE(map.nodes.size(), added);
      EXPECT_GE(map.nodes.size() + 2, added) << "one or two wait for odometry";
      EXPECT_FALSE(map.submaps.empty());
    }
    mapper.finish();
    EXPECT_EQ(content_hash(mapper.snapshot()), content_hash(mapped(drive, engine)));
  }
}

TEST(ExternalMapper, interpolates_odometry_that_comes_between_the_scans) {
  const auto drive = drive_around(121, true);
  ExternalMapper mapper(kAlpha, IcpOptions{});
  std::vector<std::size_t> steps;  // of the scans given: 1, 2, 4, 5, ...; odometry comes at 0, 3, 6, ...
  for (std::size_t step = 0; step < 121; ++step) {
    mapper.add(drive.inputs[2 * step + (step % 3 == 0 ? 0 : 1)]);
    if (step % 3 != 0) steps.push_back(step);
  }
  mapper.finish();
  const Map map = mapper.snapshot();
  ASSERT_EQ(map.nodes.size(), steps.size());
  std::size_t measured = 0;
  for (const auto& [id, constraint] : map.constraints) {
    if (id.kind != ConstraintKind::odometry) continue;
    ++measured;
    const Pose2 driven =
        between(drive.room_from_robot[steps[id.from.index]], drive.room_from_robot[steps[id.to.index]]);
    EXPECT_THAT(planar(constraint.from_from_to.pose),
                IsNear(Pose2{driven.x * 1.05, driven.y, driven.phi * 1.03}, 0.004, 0.004))
        << to_string(id.from);
  }
  EXPECT_EQ(measured, steps.size() - 1);
}

TEST(ExternalMapper, the_same_seed_gives_the_same_bytes) {
  const auto drive = drive_around(120, true);
  const auto bytes_of = [&](std::uint32_t seed) {
    RbpfOptions options = few_particles();
    options.seed = seed;
    return encode(difference(Map{}, mapped(drive, options)));
  };
  const std::string first = bytes_of(3);
  EXPECT_EQ(first, bytes_of(3));
  EXPECT_NE(first, bytes_of(4));
}

TEST(ExternalMapper, a_killed_helper_ends_its_robot_with_a_message) {
  const auto drive = drive_around(100, true);
  ExternalMapper mapper(kAlpha, IcpOptions{});
  ExternalMapper other({RobotId("beta"), SensorId("laser")}, IcpOptions{});
  for (std::size_t i = 0; i < 100; ++i) mapper.add(drive.inputs[i]);
  ASSERT_EQ(::kill(mapper.helper_process(), SIGKILL), 0);
  const Error error = error_of([&] {
    for (std::size_t i = 100; i < 200; ++i) mapper.add(drive.inputs[i]);
    mapper.finish();
  });
  EXPECT_EQ(error.code(), ErrorCode::kHelperFailed);
  EXPECT_THAT(error.what(), MatchesRegex("alpha: helper mrpt_mapper ended by signal 9 after [0-9]+ scans; .+"));
  EXPECT_EQ(mapper.helper_process(), -1);
  EXPECT_EQ(error_of([&] { mapper.finish(); }).code(), ErrorCode::kHelperFailed);
  for (const LaserInput& input : drive.inputs) other.add(input);
  other.finish();
  EXPECT_EQ(other.snapshot().nodes.size(), 100u);
}

TEST(ExternalMapper, a_helper_that_stops_reading_is_waited_for_until_ctrl_c) {
  const auto drive = drive_around(60, true);
  ExternalMapper mapper(kAlpha, IcpOptions{});
  ASSERT_EQ(::kill(mapper.helper_process(), SIGSTOP), 0);
  std::thread ctrl_c([] {
    std::this_thread::sleep_for(std::chrono::milliseconds(300));
    request_interrupt();
  });
  const auto add_far_more_than_the_stream_holds = [&] {
    for (int round = 0; round < 1000; ++round)
      for (const LaserInput& input : drive.inputs) mapper.add(input);
  };
  EXPECT_THROW(add_far_more_than_the_stream_holds(), Interrupted);
  ctrl_c.join();
  clear_interrupt();
}

TEST(ExternalMapper, a_missing_helper_is_named) {
  ExternalMapperOptions options;
  options.helper = "/nowhere/mrpt_mapper";
  const Error error = error_of([&] { ExternalMapper(kAlpha, IcpOptions{}, options); });
  EXPECT_EQ(error.code(), ErrorCode::kMissing);
  EXPECT_THAT(error.what(), HasSubstr("/nowhere/mrpt_mapper: "));
}

// A program of our own in the helper's place.
Error error_with_helper(const std::string& script) {
  const TemporaryFolder folder;
  ExternalMapperOptions options;
  options.helper = folder / "mrpt_mapper";
  std::ofstream(options.helper) << "#!/bin/sh\n" << script << "\n";
  std::filesystem::permissions(options.helper, std::filesystem::perms::owner_all);
  const auto drive = drive_around(20, true);
  return error_of([&] {
    ExternalMapper mapper(kAlpha, IcpOptions{}, options);
    for (const LaserInput& input : drive.inputs) mapper.add(input);
    mapper.finish();
  });
}

TEST(ExternalMapper, a_helper_that_leaves_early_is_an_error_and_no_map) {
  EXPECT_THAT(error_with_helper("exit 3").what(), HasSubstr("helper mrpt_mapper ended with exit code 3 after 0 scans"));
  EXPECT_THAT(error_with_helper("cat > /dev/null & sleep 0.2; kill -11 $$").what(),
              HasSubstr("ended by signal 11 after 0 scans"));
}

TEST(ExternalMapper, a_helper_that_talks_nonsense_is_an_error_and_no_map) {
  const Error error = error_with_helper("echo hello, this is not the protocol at all; exec cat > /dev/null");
  EXPECT_EQ(error.code(), ErrorCode::kHelperFailed);
  EXPECT_THAT(error.what(), HasSubstr("a frame of "));
  // "The last poses", of which there are none, said before or after it is asked for them.
  EXPECT_THAT(
      error_with_helper("printf '\\007\\000\\000\\000\\010\\006\\252\\001\\002\\030\\001'; exec cat > /dev/null")
          .what(),
      AnyOf(HasSubstr("0 poses for 20 scans"), HasSubstr("poses that nobody asked for")));
}

TEST(ExternalMapper, says_what_the_helper_could_not_do) {
  RbpfOptions options = few_particles();
  options.memory_limit_mb = 200;
  options.grid.resolution_m = 0.01;
  auto drive = drive_around(30, true);
  std::get<OdometryInput>(drive.inputs[40]).odometry_from_robot.t.x() += 1e5;  // a jump of 100 km
  const Error error = error_of([&] { mapped(drive, options); });
  EXPECT_EQ(error.code(), ErrorCode::kHelperFailed);
  EXPECT_THAT(error.what(), HasSubstr("memory_limit_mb"));
}

TEST(ExternalMapper, survives_scans_that_saw_nothing) {
  auto drive = drive_around(60, true);
  for (std::size_t i = 0; i < drive.inputs.size(); ++i)
    if (auto* scan = std::get_if<ScanInput>(&drive.inputs[i]); scan != nullptr && (i < 11 || (i > 60 && i < 70)))
      scan->scan.ranges.assign(181, 0);
  for (const std::variant<RbpfOptions, IcpOptions>& engine :
       {std::variant<RbpfOptions, IcpOptions>(IcpOptions{}), {few_particles()}})
    EXPECT_EQ(mapped(drive, engine).nodes.size(), 60u);
}

TEST(ExternalMapper, makes_an_empty_map_of_no_input) { EXPECT_TRUE(mapped({}, IcpOptions{}).empty()); }

// The process that owns the mapper is killed: nobody is left to reap or to stop the helper.
TEST(ExternalMapper, the_helper_leaves_when_the_program_dies) {
  int report[2];
  ASSERT_EQ(::pipe(report), 0);
  const pid_t program = ::fork();
  if (program == 0) {
    ExternalMapper mapper(kAlpha, few_particles());
    const int helper = mapper.helper_process();
    if (::write(report[1], &helper, sizeof helper) != sizeof helper) ::_exit(1);
    ::pause();
  }
  int helper = 0;
  ASSERT_EQ(::read(report[0], &helper, sizeof helper), static_cast<ssize_t>(sizeof helper));
  ASSERT_TRUE(std::filesystem::exists("/proc/" + std::to_string(helper)));
  ASSERT_EQ(::kill(program, SIGKILL), 0);
  ::waitpid(program, nullptr, 0);
  const auto is_gone = [&] {
    std::ifstream status("/proc/" + std::to_string(helper) + "/stat");
    std::string id, name, state;
    return !(status >> id >> name >> state) || state == "Z";  // a zombie waits for init alone
  };
  EXPECT_TRUE(wait_until(is_gone));
  ::close(report[0]);
  ::close(report[1]);
}

TEST(ExternalMapper, the_destructor_ends_and_reaps_the_helper) {
  int helper = 0;
  {
    ExternalMapper mapper(kAlpha, few_particles());
    helper = mapper.helper_process();
    for (const LaserInput& input : drive_around(50, true).inputs) mapper.add(input);
  }
  EXPECT_EQ(::kill(helper, 0), -1);
  EXPECT_EQ(errno, ESRCH);
}

}  // namespace
}  // namespace mapweave::laser
