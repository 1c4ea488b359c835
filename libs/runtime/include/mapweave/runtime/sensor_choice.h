#pragma once
// What a robot maps with, found from the beginning of its log.

#include <mapweave/runtime/run_configuration.h>
#include <mapweave/visual/frame_input.h>

#include <string>
#include <variant>
#include <vector>

namespace mapweave::runtime {

struct ChosenCamera {
  std::string label;
  visual::CameraKind kind = visual::CameraKind::mono;
};
struct ChosenSensors {
  bool laser = false;
  std::vector<ChosenCamera> cameras;  // by label
};

// Looks at the first seconds of the log. Throws Error: what open_log throws, kBadInput where the log has no such
// sensor, naming those that it has.
ChosenSensors choose_sensors(const std::filesystem::path& log, const RunConfiguration&);

}  // namespace mapweave::runtime
