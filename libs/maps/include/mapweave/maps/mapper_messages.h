#pragma once
// What the program and a helper that maps one robot's scans for it send each other. Byte forms: as exchange.h.

#include <mapweave/core/geometry.h>
#include <mapweave/maps/exchange.h>
#include <mapweave/maps/receipt.h>

#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace mapweave {

// Program -> helper: the first word; what the robot senses follows.
struct EngineStart {
  struct Option {
    std::string name;
    double value = 0.0;
  };
  std::string engine;
  std::vector<Option> options;  // all of the engine's, in their order
};
// Program -> helper: where all scans that are finished lie, as it is known now.
struct PosesWanted {};
using MapperInput = std::variant<EngineStart, Sensed, PosesWanted>;

struct ScanPose {
  Pose2 map_from_robot;
  Pose2 previous_from_this;  // motion since the previous scan, before any map was consulted; identity for the first
  bool by_wheels = false;    // measured by odometry, not by matching scans
};

// Helper -> program: how far it is; when they are wanted and at the end, the poses in the order of the scans, in as
// many messages as it takes; or why it failed.
struct MapperProgress {
  std::uint64_t scans = 0;  // finished
};
struct ScanPoses {
  std::vector<ScanPose> poses;
  bool is_last = false;
};
using MapperOutput = std::variant<MapperProgress, ScanPoses, Refusal>;

std::string encode(const MapperInput&);
std::string encode(const MapperOutput&);
MapperInput decode_mapper_input(std::string_view bytes, const std::string& where);
MapperOutput decode_mapper_output(std::string_view bytes, const std::string& where);

}  // namespace mapweave
