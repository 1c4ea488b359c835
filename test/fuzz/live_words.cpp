// What programs of a deployment say to each other as JSON, and what is kept of it.

#include "fuzz_target.h"

#include <live/cluster_task.h>
#include <live/program_word.h>
#include <mapweave/runtime/deployment_keys.h>
#include <mapweave/runtime/live_plan.h>
#include <mapweave/runtime/live_requests.h>
#include <runtime/robot_records.h>
#include <team/kept_requests.h>

namespace mapweave::fuzz {
namespace {

using namespace runtime;

const RunPlan& plan() {
  static const RunPlan made = [] {
    RunPlan plan;
    for (const char* name : {"alpha", "beta"}) {
      plan.robots.emplace_back();
      plan.robots.back().id = RobotId(name);
    }
    plan.edges = {TierId("north")};
    return plan;
  }();
  return made;
}

Kind requests() {
  LiveRequests sound;
  sound.refused = {{RobotId("alpha"), RobotId("beta")}};
  sound.starts[RobotId("beta")] = {1.0, -2.0, 0.5, 0.3, 0.2};
  return {
      round_trip([](std::string_view bytes, const char* where) { return decode_live_requests(bytes, plan(), where); }),
      {encode(sound)}};
}

Kind plans() {
  const LivePlan sound{5, 2, true, false, {{RobotId("alpha"), TierId("north")}, {RobotId("beta"), TierId()}}};
  return {round_trip(decode_live_plan), {encode(sound)}};
}

Kind words() {
  return {[](std::string_view bytes) { decode_program_word(bytes, kWhere); },
          {R"({"said_at_ns": 5, "tiers": [{"is_done": true, "is_sealing": false, "ended": ["alpha"],
               "counts": {"plan": 3, "scans": 200, "mapping_seconds": 1.5},
               "links": [{"name": "cloud", "counts": {"queue_bytes": 7, "bytes_per_second": 1e6}}]}]})"}};
}

Kind several() {
  const auto decode = [](std::string_view bytes) {
    const auto messages = unpacked(bytes, kWhere);
    expect(unpacked(packed(messages, 2 * bytes.size() + 100), kWhere) == messages, "messages come back as they were");
  };
  return {decode, {packed({"one", "", "three\n"}, 100)}};
}

Kind records() {
  RobotRecord laser;
  laser.robot = RobotId("alpha");
  laser.log = "alpha.rawlog";
  laser.sensor = "laser";
  laser.scans = 7;
  laser.notes = {"a note"};
  laser.live = laser.odometry = test::path(2);
  return {round_trip(decode_robot_record), {encode(laser), encode(test::record_of_cameras())}};
}

Kind tasks() {
  ClusterTask sound;
  sound.version = "0.1.0";
  sound.robot = RobotId("alpha");
  sound.log = "alpha.rawlog";
  sound.configuration = "robots:\n  - id: alpha\n    log: alpha.rawlog\n";
  const auto decode = [](std::string_view bytes) {
    const ClusterTask task = decode_cluster_task(bytes, kWhere);
    plan_of(task, "none.rawlog");
  };
  const auto decode_alone = round_trip(decode_cluster_task);
  return {[=](std::string_view bytes) {
            decode_alone(bytes);
            try {
              decode(bytes);
            } catch (const Error& error) {
              expect(error.code() != ErrorCode::kInternal, error.what());
            }
          },
          {encode(sound)}};
}

Kind keys() {
  return {[](std::string_view bytes) { read_program_keys(scratch_file("keys.json", bytes)); },
          {encode(ProgramKeys{"alpha", "secret", "-----BEGIN CERTIFICATE-----\n"})}};
}

Kind kept() {
  return {[](std::string_view bytes) {
            const KeptRequests read = kept_in({{"requests", std::string(bytes)}}, kWhere);
            std::map<std::string, std::string> metadata;
            std::vector<MapId> all;
            for (const auto& [a, b] : read.refused) all.push_back(a);
            keep(read, all, metadata);
          },
          {R"({"refused": [["alpha", "beta"]], "priors": [{"a": "alpha", "b": "beta", "a_from_b": [1, 2, 0.5],
               "sigma_m": 0.5, "sigma_rad": 0.1}], "options": ["fusion.merge_probability=0.9"], "vocabulary": "ab"})"}};
}

const std::vector<Kind>& kinds() {
  static const std::vector<Kind> all = {requests(), plans(), words(), several(), records(), tasks(), keys(), kept()};
  return all;
}

}  // namespace

std::vector<std::string> seeds() { return seeds_of(kinds()); }
void decode(std::string_view bytes) { decode_one_of(kinds(), bytes); }

}  // namespace mapweave::fuzz
