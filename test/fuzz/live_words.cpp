// What programs of a deployment say to each other as JSON, and what is kept of it.

#include "fuzz_target.h"

#include <live/cluster_work.h>
#include <live/program_word.h>
#include <mapweave/maps/pair_to_judge.h>
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

ClusterTask task_of_kind(ClusterTaskKind kind, std::vector<std::string> blobs) {
  ClusterTask task;
  task.version = "0.1.0";
  task.kind = kind;
  task.name = "robot alpha";
  task.configuration = "output: {octomap: true}\n";
  task.robots = {{RobotId("alpha"), "alpha.rawlog", {}, "robots:\n  - id: alpha\n    log: alpha.rawlog\n"}};
  task.blobs = std::move(blobs);
  return task;
}

// Envelopes as one text: how long each is, then its bytes; the first one is the head.
std::string joined(const std::vector<transport::Envelope>& envelopes) {
  std::string bytes;
  for (const transport::Envelope& envelope : envelopes)
    bytes += std::to_string(envelope.bytes.size()) + "\n" + envelope.bytes;
  return bytes;
}

void do_task(const ClusterTask& task) {
  const auto progress = make_silent_progress();
  switch (task.kind) {
    case ClusterTaskKind::robot: plan_of(task, "none.rawlog"); return;
    case ClusterTaskKind::judging: judged_by_worker(task, *progress); return;
    case ClusterTaskKind::dense_map:
      drawn_by_worker(task, std::vector<std::filesystem::path>(task.robots.size(), "none.rawlog"), *progress);
      return;
  }
}

Kind tasks() {
  const auto decode = [](std::string_view bytes) {
    ClusterReader reader;
    const char* subject = cluster_subject::kTask;
    while (!bytes.empty()) {
      const std::size_t line = std::min(bytes.find('\n'), bytes.size() - 1);
      const std::size_t size = std::strtoul(std::string(bytes.substr(0, line)).c_str(), nullptr, 10);
      bytes.remove_prefix(line + 1);
      auto message = reader.add({subject, std::string(bytes.substr(0, size))}, kWhere);
      bytes.remove_prefix(std::min(size, bytes.size()));
      subject = cluster_subject::kPart;
      if (!message) continue;
      subject = cluster_subject::kTask;
      do_task(decode_cluster_task(std::move(*message), kWhere));
    }
  };
  return {[=](std::string_view bytes) {
            try {
              decode(bytes);
            } catch (const Error& error) {
              expect(error.code() != ErrorCode::kInternal, error.what());
            }
          },
          {joined(envelopes_of(task_of_kind(ClusterTaskKind::robot, {}))),
           joined(envelopes_of(
               task_of_kind(ClusterTaskKind::judging,
                            {encode(std::vector<PairToJudge>{{MapId("alpha"), MapId("beta"), {}, true}}), "update"}))),
           joined(envelopes_of(task_of_kind(
               ClusterTaskKind::dense_map,
               {R"({"ply": true, "octomap": true, "trajectories": [{"robot": "alpha", "label": "rgbd", "kind": "rgbd",
                   "readout_s": 0, "inverse_depth_offset": 0, "frames": [], "keyframes": [1]}],
                   "slabs": [{"height_m": 0.5, "resolution_m": 0.05, "origin_x_m": 0, "origin_y_m": 0, "columns": 2,
                   "rows": 1}]})",
                std::string(4, '\0')})))}};
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
