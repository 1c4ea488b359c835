// MRPT's rawlogs, as they are and as .gz.

#include "logs.h"

#include <rawlog/logs.h>

#include <mrpt/obs/CObservation3DRangeScan.h>
#include <mrpt/obs/CObservationIMU.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <zlib.h>

namespace mapweave::fuzz {
namespace {

using namespace rawlog;

std::string unpacked(const std::filesystem::path& path) {
  constexpr unsigned kMost = 100'000;
  std::string bytes(kMost, '\0');
  gzFile file = gzopen(path.c_str(), "rb");
  expect(file != nullptr, path.string() + " is there");
  bytes.resize(static_cast<std::size_t>(gzread(file, bytes.data(), kMost)));
  gzclose(file);
  return bytes;
}

std::string laser_drive() {
  std::string bytes;
  for (const auto& object :
       {Object(odometry(1.0, 1.0, 2.0, 0.3)), Object(scan(1.0)), Object(odometry(2.0, 1.5)), Object(scan(2.0))})
    bytes += serialized(*object);
  return bytes;
}

std::string other_sensors() {
  mrpt::obs::CSensoryFrame frame;
  frame.insert(scan(2.5));
  mrpt::obs::CObservationIMU inertial;
  inertial.timestamp = at(2.6);
  inertial.sensorLabel = "IMU";
  mrpt::obs::CObservation3DRangeScan depth;
  depth.timestamp = at(2.7);
  depth.sensorLabel = "DEPTH";
  depth.cameraParams.ncols = 5;
  depth.cameraParams.nrows = 4;
  depth.hasRangeImage = true;
  depth.rangeImage.resize(4, 5);
  depth.rangeImage.fill(1000);
  return serialized(frame) + serialized(inertial) + serialized(depth);
}

}  // namespace

std::vector<std::string> seeds() {
  const auto packed = write_rawlog(scratch_folder() / "sound.rawlog", {odometry(1.0), scan(1.0), scan(2.0)});
  return {laser_drive(), other_sensors(), laser_drive() + other_sensors(),
          unpacked(test::own_data("rawlog_pairs.rawlog")), file_bytes(packed)};
}

void decode(std::string_view bytes) { read_log(scratch_file("input.rawlog", bytes)); }

}  // namespace mapweave::fuzz
