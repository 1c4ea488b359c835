#pragma once
// Kinds of sensors that a robot can map with, in one table: it names them for `sensor` and `--sensor`, knows their
// records, and says which task maps them. A kind that ends in planar scans or in frames is a line here and a converter.

#include <mapweave/laser/depth_scans.h>
#include <mapweave/visual/frame_input.h>

#include <array>
#include <memory>
#include <string>
#include <string_view>
#include <vector>

namespace mapweave::runtime {

enum class SensorTask {
  scans,  // LaserTask, on an edge or on the robot; reports: scans, packing and mapping
  frames  // CameraTask, on the robot; reports: frames, seeing
};

struct SensorKind {
  using Stream = std::unique_ptr<rawlog::ObservationStream>;
  std::string_view name, in_words;
  SensorTask task;
  bool (*recognises)(const mrpt::obs::CObservation&);
  Stream (*as_scans)(Stream log) = nullptr;                   // null: its records are planar scans
  visual::CameraKind camera = visual::CameraKind::automatic;  // for frames: what is used of each picture
};

bool is_planar_scan(const mrpt::obs::CObservation&);
bool is_depth_picture(const mrpt::obs::CObservation&);  // a depth picture, with or without colours
bool is_picture(const mrpt::obs::CObservation&);        // a picture of any camera
bool is_stereo(const mrpt::obs::CObservation&);
bool is_rgbd(const mrpt::obs::CObservation&);

// The preferred ones first: a record counts for the first kind that knows it, and `auto` takes the first of a
// log.
inline constexpr SensorKind kSensorKinds[] = {
    {"laser", "laser", SensorTask::scans, is_planar_scan},
    {"rgbd", "depth camera", SensorTask::frames, is_rgbd, nullptr, visual::CameraKind::rgbd},
    {"stereo", "stereo pair", SensorTask::frames, is_stereo, nullptr, visual::CameraKind::stereo},
    {"mono", "single camera", SensorTask::frames, is_picture, nullptr, visual::CameraKind::mono},
    {"depth", "depth sensor", SensorTask::scans, is_depth_picture, laser::depth_scans},
};
inline constexpr const SensorKind& kLaser = kSensorKinds[0];

// What `sensor` may be: one kind, or several. cameras: all, with the most that each gives; all: laser and cameras.
inline constexpr auto kSensorChoices = [] {
  std::array<std::string_view, std::size(kSensorKinds) + 3> names{"auto"};
  std::size_t count = 1;
  for (const SensorKind& kind : kSensorKinds) names[count++] = kind.name;
  names[count++] = "cameras";
  names[count] = "all";
  return names;
}();
inline constexpr const char* kSensorChoiceText =
    "sensors to map with; auto: the laser if a log has one, else its cameras, else its depth sensor; cameras: all "
    "cameras with all that each gives; all: laser and cameras in one pose graph; mono, stereo and rgbd use just that "
    "of each camera; depth: depth pictures as scans of a laser";

// The kind of this name; null for auto, cameras and all.
const SensorKind* sensor_kind(std::string_view name);

struct ChosenCamera {
  std::string label;
  const SensorKind* kind = nullptr;
};
struct ChosenSensors {
  const SensorKind* scans = nullptr;  // what LaserTask maps; null: nothing
  std::vector<ChosenCamera> cameras;  // by label
};

}  // namespace mapweave::runtime
