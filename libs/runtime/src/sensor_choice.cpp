#include <mapweave/core/error.h>
#include <mapweave/core/nearest_name.h>
#include <mapweave/runtime/sensor_choice.h>

#include <mrpt/obs/CObservation2DRangeScan.h>

#include <map>

namespace mapweave::runtime {
namespace {

using visual::CameraKind;

constexpr double kLook_s = 5.0;
constexpr int kLookRecords = 3000;

struct Found {
  bool laser = false;
  std::map<std::string, CameraKind> cameras;  // with the most that each gives
};

int worth(CameraKind kind) { return static_cast<int>(kind); }

Found look(const std::filesystem::path& log, const rawlog::ReadOptions& reading, bool laser_is_enough) {
  Found found;
  const auto stream = rawlog::open_log(log, reading);
  std::optional<Stamp> first;
  try {
    for (int count = 0; count < kLookRecords; ++count) {
      const auto record = stream->next();
      if (!record) break;
      if (!first) first = record->stamp;
      const bool anything = found.laser || !found.cameras.empty();
      if (found.laser && laser_is_enough) break;
      if (!found.cameras.empty() && std::filesystem::is_directory(log)) break;  // a folder of pictures is of one camera
      if (anything && seconds_between(*first, record->stamp) > kLook_s) break;
      found.laser =
          found.laser || dynamic_cast<const mrpt::obs::CObservation2DRangeScan*>(record->observation.get()) != nullptr;
      if (const auto kind = visual::camera_kind(*record->observation)) {
        CameraKind& known = found.cameras.emplace(record->observation->sensorLabel, *kind).first->second;
        if (worth(*kind) > worth(known)) known = *kind;
      }
    }
  } catch (const Error&) {
    // The mapping reports it, after what came before it.
    if (!found.laser && found.cameras.empty()) throw;
  }
  return found;
}

std::string in_words(CameraKind kind) {
  switch (kind) {
    case CameraKind::rgbd: return "depth camera";
    case CameraKind::stereo: return "stereo pair";
    default: return "single camera";
  }
}

std::string in_words(const Found& found) {
  std::string text = found.laser ? "a laser" : "";
  for (const auto& [label, kind] : found.cameras)
    text += (text.empty() ? "" : ", ") + in_words(kind) + " '" + label + "'";
  return text.empty() ? "no laser and no camera" : text;
}

CameraKind kind_of(SensorChoice sensor) {
  switch (sensor) {
    case SensorChoice::mono: return CameraKind::mono;
    case SensorChoice::stereo: return CameraKind::stereo;
    case SensorChoice::rgbd: return CameraKind::rgbd;
    default: return CameraKind::automatic;
  }
}

}  // namespace

ChosenSensors choose_sensors(const std::filesystem::path& log, const RunConfiguration& configuration) {
  const bool all = configuration.sensor == SensorChoice::all;
  if (configuration.sensor == SensorChoice::laser) return {true, {}};
  const Found found = look(log, configuration.reading, configuration.sensor == SensorChoice::automatic);
  if (configuration.sensor == SensorChoice::automatic && found.laser) return {true, {}};
  const CameraKind wanted = kind_of(configuration.sensor);
  const std::string& label = configuration.visual.label;
  ChosenSensors chosen;
  std::vector<std::string> labels;
  for (const auto& [name, kind] : found.cameras) {
    labels.push_back(name);
    if (!label.empty() && name != label) continue;
    if (wanted == CameraKind::automatic || wanted == CameraKind::mono || wanted == kind)
      chosen.cameras.push_back({name, wanted == CameraKind::automatic ? kind : wanted});
  }
  chosen.laser = all && found.laser;
  if (chosen.laser || !chosen.cameras.empty()) return chosen;
  if (!label.empty() && found.cameras.count(label) == 0 && !labels.empty()) {
    const auto nearest = nearest_name(label, labels);
    throw Error(ErrorCode::kBadInput, "the log has no camera '" + label + "'; it has " + in_words(found), log.string(),
                nearest ? "did you mean '" + *nearest + "'?" : "choose one of them with visual.label");
  }
  if (wanted == CameraKind::automatic && configuration.sensor != SensorChoice::cameras)
    return {true, {}};  // a laser may still come, and its absence is reported by who maps with it
  throw Error(ErrorCode::kBadInput,
              "the log has no " + (wanted == CameraKind::automatic ? "camera" : in_words(wanted)) + "; it has " +
                  in_words(found),
              log.string(), "choose another sensor, or leave the choice to auto");
}

}  // namespace mapweave::runtime
