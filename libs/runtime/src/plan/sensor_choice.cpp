#include <mapweave/core/error.h>
#include <mapweave/core/nearest_name.h>
#include <mapweave/rawlog/contents.h>
#include <mapweave/runtime/sensor_choice.h>

#include <algorithm>
#include <iterator>
#include <map>
#include <set>

namespace mapweave::runtime {
namespace {

constexpr double kLook_s = 5.0;
constexpr int kLookRecords = 3000;

// What the beginning of a log shows.
struct Found {
  std::set<const SensorKind*> scans;                 // in the order of the table
  std::map<std::string, const SensorKind*> cameras;  // by label, with the most that each gives
};

void note(const mrpt::obs::CObservation& observation, Found& found) {
  const auto kind = std::find_if(std::begin(kSensorKinds), std::end(kSensorKinds),
                                 [&](const SensorKind& one) { return one.recognises(observation); });
  if (kind == std::end(kSensorKinds)) return;
  if (kind->task == SensorTask::scans) {
    found.scans.insert(kind);
  } else {
    const SensorKind*& known = found.cameras.emplace(observation.sensorLabel, kind).first->second;
    known = std::min(known, static_cast<const SensorKind*>(kind));
  }
}

Found look(const std::filesystem::path& log, const rawlog::ReadOptions& reading, bool laser_is_enough) {
  Found found;
  const auto stream = rawlog::open_log(log, reading);
  std::optional<Stamp> first;
  try {
    for (int count = 0; count < kLookRecords; ++count) {
      const auto record = stream->next();
      if (!record) break;
      if (!first) first = record->stamp;
      const bool has_laser = found.scans.count(&kLaser) != 0;
      const bool is_preferred = has_laser || !found.cameras.empty();  // to a depth sensor
      if (has_laser && laser_is_enough) break;
      if (!found.cameras.empty() && rawlog::is_picture_folder(log)) break;  // a folder of pictures is of one camera
      if (is_preferred && seconds_between(*first, record->stamp) > kLook_s) break;
      note(*record->observation, found);
    }
  } catch (const Error&) {
    // The mapper reports this error when it reaches the damaged record.
    if (found.scans.empty() && found.cameras.empty()) throw;
  }
  return found;
}

std::string in_words(const Found& found) {
  std::string text;
  const auto add = [&text](const std::string& one) { text += (text.empty() ? "" : ", ") + one; };
  for (const SensorKind* kind : found.scans) add("a " + std::string(kind->in_words));
  for (const auto& [label, kind] : found.cameras) add(std::string(kind->in_words) + " '" + label + "'");
  return text.empty() ? "no laser and no camera" : text;
}

// `wanted`: of this kind alone; null: all of them, with the most that each gives.
std::vector<ChosenCamera> cameras_of(const Found& found, const SensorKind* wanted, const std::string& label) {
  std::vector<ChosenCamera> chosen;
  for (const auto& [name, kind] : found.cameras) {
    if (!label.empty() && name != label) continue;
    // A picture is all that a single camera gives, and all others do, too.
    if (wanted == nullptr || wanted == kind || wanted->camera == visual::CameraKind::mono)
      chosen.push_back({name, wanted == nullptr ? kind : wanted});
  }
  return chosen;
}

void expect_label(const std::string& label, const Found& found, const std::filesystem::path& log) {
  if (label.empty() || found.cameras.empty() || found.cameras.count(label) != 0) return;
  std::vector<std::string> labels;
  for (const auto& [name, kind] : found.cameras) labels.push_back(name);
  const auto nearest = nearest_name(label, labels);
  throw Error(ErrorCode::kBadInput, "the log has no camera '" + label + "'; it has " + in_words(found), log.string(),
              nearest ? "did you mean '" + *nearest + "'?" : "choose one of them with visual.label");
}

// A folder of pictures shows with its first ones what it has; in other logs a sensor may come late.
void expect_in_folder(const SensorKind& wanted, const std::filesystem::path& log, const rawlog::ReadOptions& reading) {
  if (!rawlog::is_picture_folder(log)) return;
  const auto stream = rawlog::open_log(log, reading);
  for (int count = 0; count < kLookRecords; ++count) {
    const auto record = stream->next();
    if (!record) return;
    if (wanted.recognises(*record->observation)) return;
    Found found;
    note(*record->observation, found);
    if (found.cameras.empty()) continue;
    throw Error(ErrorCode::kBadInput, "the log has no " + std::string(wanted.in_words) + "; it has " + in_words(found),
                log.string(), "choose another sensor, or leave the choice to auto");
  }
}

ChosenSensors choose(const std::filesystem::path& log, const RunConfiguration& configuration) {
  const std::string& sensor = configuration.sensor;
  const SensorKind* wanted = sensor_kind(sensor);
  if (wanted != nullptr && wanted->task == SensorTask::scans) {
    expect_in_folder(*wanted, log, configuration.reading);
    return {wanted, {}};
  }
  const bool is_automatic = sensor == "auto";
  const Found found = look(log, configuration.reading, is_automatic);
  const SensorKind* laser = found.scans.count(&kLaser) != 0 ? &kLaser : nullptr;
  if (is_automatic && laser != nullptr) return {laser, {}};
  const ChosenSensors chosen{sensor == "all" ? laser : nullptr, cameras_of(found, wanted, configuration.visual.label)};
  if (chosen.scans != nullptr || !chosen.cameras.empty()) return chosen;
  expect_label(configuration.visual.label, found, log);
  if (is_automatic || sensor == "all")  // a laser may still come, and its absence is reported by who maps with it
    return {found.scans.empty() ? &kLaser : *found.scans.begin(), {}};
  throw Error(
      ErrorCode::kBadInput,
      "the log has no " + std::string(wanted == nullptr ? "camera" : wanted->in_words) + "; it has " + in_words(found),
      log.string(), "choose another sensor, or leave the choice to auto");
}

}  // namespace

void choose_sensors(RunPlan& plan, const RunConfiguration& configuration, WorkerPool& pool) {
  pool.for_each(plan.robots.size(), [&](std::size_t i) {
    PlannedRobot& robot = plan.robots[i];
    try {
      robot.sensors = choose(robot.log, configuration_of(configuration, robot));
    } catch (const Error& error) {
      robot.trouble = error;
    }
  });
}

}  // namespace mapweave::runtime
