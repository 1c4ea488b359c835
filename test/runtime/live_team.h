#pragma once
// Robots, edges and a cloud as if each were a program of its own, over channels of this process, and what `run` leaves
// of the same configuration.

#include "simulated_team.h"

#include <mapweave/core/files.h>
#include <mapweave/runtime/batch_runner.h>
#include <mapweave/runtime/live_cloud.h>
#include <mapweave/runtime/sensor_choice.h>
#include <mapweave/transport/in_process_channel.h>
#include <support/bad_channel.h>
#include <support/slowness.h>

#include <gtest/gtest.h>
#include <nlohmann/json.hpp>

#include <atomic>
#include <chrono>
#include <map>
#include <memory>
#include <thread>
#include <utility>

namespace mapweave::runtime::test_support {

using nlohmann::json;
using test::BadChannel;
using test::Badness;
using test::kSlowness;
namespace fs = std::filesystem;
using namespace std::chrono_literals;

inline constexpr auto kPatience = 120s * kSlowness;  // for a machine that is busy

inline const SimulatedTeam& three_robots() {
  static const SimulatedTeam team(true);
  return team;
}

inline RunConfiguration three_robots_configuration() {
  RunConfiguration configuration = three_robots().configuration();
  configuration.output.report = false;
  return configuration;
}

// Merges without what was measured.
inline json merges_of(const fs::path& folder) {
  json merges = json::parse(read_file(folder / "merges.json"));
  const std::function<void(json&)> strip = [&](json& value) {
    if (value.is_object())
      for (auto it = value.begin(); it != value.end();)
        if (it.key() == "seconds")
          it = value.erase(it);
        else
          strip(*it++);
    else if (value.is_array())
      for (json& one : value) strip(one);
  };
  strip(merges);
  return merges;
}

inline json outputs_of(const fs::path& folder) { return json::parse(read_file(folder / "manifest.json"))["outputs"]; }

// What `run` leaves of the same configuration; once.
inline const fs::path& as_run() {
  static const test::TemporaryFolder folder;
  static const fs::path out = folder / "run";
  if (!fs::exists(out)) {
    const RunConfiguration configuration = three_robots_configuration();
    WorkerPool pool(1);
    run_batch(configuration, make_plan(configuration, {}), {out, false, false}, pool, *make_silent_progress());
  }
  return out;
}

struct LiveTeam : testing::Test {
  LiveTeam() {
    options.speed = 0.0;
    options.preview_period_s = 0.2;
    options.wire.repeat_s = 0.2 * test::kSlowness;
    choose_sensors(plan, configuration, pool);
  }
  ~LiveTeam() override {
    robots.clear();
    edges.clear();
    cloud.reset();
  }

  LiveSite site(const std::string& journal) {
    return {configuration, plan,    options,
            pool,          *silent, journal.empty() ? std::nullopt : std::optional(folder / (journal + ".mwj")),
            keeps_previews};
  }
  void start_cloud(const std::string& journal = "") {
    auto started = std::make_unique<LiveCloud>(site(journal), settings);
    const std::lock_guard lock(mutex);
    cloud = std::move(started);
  }
  void start_edge(const std::string& name, const std::string& journal = "") {
    auto edge =
        std::make_unique<LiveEdge>(TierId(name), site(journal), [this]() -> std::shared_ptr<transport::Channel> {
          const std::lock_guard lock(mutex);
          return cloud ? worse(cloud->connect()) : nullptr;
        });
    const std::lock_guard lock(mutex);
    edges[name] = std::move(edge);
  }
  void start_robot(const PlannedRobot& robot) {
    robots.push_back(std::make_unique<LiveRobot>(
        robot, configuration, options,
        [this](const TierId& edge) -> std::shared_ptr<transport::Channel> {
          const std::lock_guard lock(mutex);
          const auto found = edges.find(edge.str());
          return found != edges.end() && found->second ? worse(found->second->connect()) : nullptr;
        },
        [this, id = robot.id](const TierId& edge, int) { return connect_camera(id, edge); }));
  }
  // Both ends suffer alike.
  std::shared_ptr<transport::Channel> connect_camera(const RobotId& robot, const TierId& edge) {
    const std::lock_guard lock(mutex);
    const auto found = edges.find(edge.str());
    if (found == edges.end() || !found->second) return nullptr;
    const auto channel = transport::make_in_process_channel({std::size_t{4} << 20, 4096});
    found->second->serve_camera(robot, worse(channel.second));
    return worse(channel.first);
  }
  void start_robots() {
    for (const PlannedRobot& robot : plan.robots) start_robot(robot);
  }
  // As if it were killed: whatever it did not save is gone.
  void end_edge(const std::string& name) {
    std::unique_ptr<LiveEdge> gone;
    const std::lock_guard lock(mutex);
    gone = std::move(edges[name]);
  }
  void end_cloud() {
    std::unique_ptr<LiveCloud> gone;
    const std::lock_guard lock(mutex);
    gone = std::move(cloud);
  }
  std::shared_ptr<transport::Channel> worse(std::shared_ptr<transport::Channel> channel) {
    if (badness.lost + badness.doubled + badness.cut == 0.0) return channel;
    Badness one = badness;
    one.seed += ++connected;
    return std::make_shared<BadChannel>(std::move(channel), one);
  }
  std::uint64_t taken(const std::string& edge) {
    std::uint64_t sum = 0;
    for (const auto& robot : edges.at(edge)->counts().robots) sum += robot.taken;
    return sum;
  }
  template <class Condition>
  void await(Condition&& condition) {
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while (!condition()) {
      ASSERT_LT(std::chrono::steady_clock::now(), end);
      std::this_thread::sleep_for(5ms);
    }
  }
  Report result() {
    const std::optional<Report> report = cloud->wait(kPatience);
    if (!report) throw std::runtime_error("the cloud has no result");
    return *report;
  }
  void expect_as_run() {
    json live = outputs_of(settings.out), run = outputs_of(as_run());
    EXPECT_EQ(live, run);
    EXPECT_GT(run.size(), 20u);
    EXPECT_EQ(merges_of(settings.out), merges_of(as_run()));
  }

  test::TemporaryFolder folder;
  RunSettings settings{folder / "live", false, false};
  RunConfiguration configuration = three_robots_configuration();
  RunPlan plan = make_plan(configuration, {});
  LiveOptions options;
  bool keeps_previews = false;
  WorkerPool pool{2};
  std::unique_ptr<Progress> silent = make_silent_progress();
  Badness badness;
  std::atomic<std::uint64_t> connected{0};
  std::mutex mutex;
  std::unique_ptr<LiveCloud> cloud;
  std::map<std::string, std::unique_ptr<LiveEdge>> edges;
  std::vector<std::unique_ptr<LiveRobot>> robots;
};

}  // namespace mapweave::runtime::test_support
