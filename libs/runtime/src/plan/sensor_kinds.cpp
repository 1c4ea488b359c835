#include <mapweave/runtime/sensor_kinds.h>

#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/obs/CObservation3DRangeScan.h>

namespace mapweave::runtime {

bool is_planar_scan(const mrpt::obs::CObservation& observation) {
  return dynamic_cast<const mrpt::obs::CObservation2DRangeScan*>(&observation) != nullptr;
}
bool is_depth_picture(const mrpt::obs::CObservation& observation) {
  const auto* picture = dynamic_cast<const mrpt::obs::CObservation3DRangeScan*>(&observation);
  return picture != nullptr && picture->hasRangeImage;
}
bool is_picture(const mrpt::obs::CObservation& observation) { return visual::camera_kind(observation).has_value(); }
bool is_stereo(const mrpt::obs::CObservation& observation) {
  return visual::camera_kind(observation) == visual::CameraKind::stereo;
}
bool is_rgbd(const mrpt::obs::CObservation& observation) {
  return visual::camera_kind(observation) == visual::CameraKind::rgbd;
}

const SensorKind* sensor_kind(std::string_view name) {
  for (const SensorKind& kind : kSensorKinds)
    if (kind.name == name) return &kind;
  return nullptr;
}

}  // namespace mapweave::runtime
