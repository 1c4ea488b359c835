#pragma once
// Small logs for the tests of rawlog, written by MRPT itself, and what came out of reading them.

#include <gmock/gmock.h>
#include <mapweave/core/error.h>
#include <mapweave/core/geometry.h>
#include <mapweave/rawlog/observation_stream.h>
#include <mrpt/io/CFileGZOutputStream.h>
#include <mrpt/io/CFileOutputStream.h>
#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/obs/CObservationOdometry.h>
#include <mrpt/serialization/CArchive.h>
#include <support/data.h>
#include <support/temporary_folder.h>

#include <fstream>
#include <memory>
#include <string>
#include <vector>

namespace mapweave::rawlog {

using Object = std::shared_ptr<mrpt::serialization::CSerializable>;

inline mrpt::Clock::time_point at(double seconds) { return to_mrpt_time(stamp_from_seconds(seconds)); }

inline std::shared_ptr<mrpt::obs::CObservation2DRangeScan> scan(double seconds, std::vector<float> ranges = {
                                                                                    1.0f, 2.0f, 3.0f, 4.0f, 5.0f}) {
  auto made = std::make_shared<mrpt::obs::CObservation2DRangeScan>();
  made->timestamp = at(seconds);
  made->sensorLabel = "LASER";
  const std::vector<char> valid(ranges.size(), 1);
  if (!ranges.empty()) made->loadFromVectors(ranges.size(), ranges.data(), valid.data());
  made->sensorPose = mrpt::poses::CPose3D(0.1, 0.2, 0.3, 0.4, 0.0, 0.0);
  return made;
}

inline std::shared_ptr<mrpt::obs::CObservationOdometry> odometry(double seconds, double x = 0.0, double y = 0.0,
                                                                 double heading = 0.0) {
  auto made = std::make_shared<mrpt::obs::CObservationOdometry>();
  made->timestamp = at(seconds);
  made->sensorLabel = "ODOM";
  made->odometry = mrpt::poses::CPose2D(x, y, heading);
  return made;
}

// Null objects too.
inline std::filesystem::path write_rawlog(const std::filesystem::path& path, const std::vector<Object>& objects,
                                          bool gz = true) {
  const auto write_all = [&](auto&& archive) {
    for (const auto& object : objects) archive.WriteObject(object.get());
  };
  if (gz) {
    mrpt::io::CFileGZOutputStream file(path.string());
    write_all(mrpt::serialization::archiveFrom(file));
  } else {
    mrpt::io::CFileOutputStream file(path.string());
    write_all(mrpt::serialization::archiveFrom(file));
  }
  return path;
}

inline std::string bytes_of(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  return {std::istreambuf_iterator<char>(file), {}};
}

inline std::filesystem::path write_bytes(const std::filesystem::path& path, const std::string& bytes) {
  std::filesystem::remove(path);  // ext4 syncs a file that was truncated, not a new one
  std::ofstream(path, std::ios::binary) << bytes;
  return path;
}

struct Reading {
  std::vector<Record> records;
  std::unique_ptr<Error> error;  // that ended it; null at the clean end
};

inline Reading read_all(const std::filesystem::path& path, const ReadOptions& options = {}) {
  Reading reading;
  try {
    const auto stream = open_log(path, options);
    while (auto record = stream->next()) reading.records.push_back(*record);
  } catch (const Error& error) {
    reading.error = std::make_unique<Error>(error);
  }
  return reading;
}

inline std::string kinds(const std::vector<Record>& records) {  // "os": odometry, then a scan
  std::string letters;
  for (const auto& record : records) {
    const auto* observation = record.observation.get();
    letters += dynamic_cast<const mrpt::obs::CObservationOdometry*>(observation) != nullptr      ? 'o'
               : dynamic_cast<const mrpt::obs::CObservation2DRangeScan*>(observation) != nullptr ? 's'
                                                                                                 : '?';
  }
  return letters;
}

inline std::vector<double> seconds(const std::vector<Record>& records) {
  std::vector<double> stamps;
  for (const auto& record : records) stamps.push_back(record.stamp.seconds());
  return stamps;
}

inline const mrpt::obs::CObservation2DRangeScan& scan_of(const Record& record) {
  return dynamic_cast<const mrpt::obs::CObservation2DRangeScan&>(*record.observation);
}
inline Pose2 odometry_of(const Record& record) {
  return dynamic_cast<const mrpt::obs::CObservationOdometry&>(*record.observation).odometry.asTPose();
}
// In the robot's frame, counter-clockwise from its x axis; of lasers that stand upright.
inline double ray_angle(const mrpt::obs::CObservation2DRangeScan& scan, std::size_t ray) {
  return scan.sensorPose.yaw() + scan.getScanAngle(ray);
}

MATCHER_P2(IsError, code, text, "is an Error of that code which says '" + std::string(text) + "'") {
  if (!arg) {
    *result_listener << "there is none";
    return false;
  }
  *result_listener << "says: " << arg->what();
  return arg->code() == code && std::string(arg->what()).find(text) != std::string::npos;
}

// The bytes of an object as MRPT writes it: equal bytes are equal content.
inline std::string serialized(const mrpt::serialization::CSerializable& object) {
  struct Archive : mrpt::serialization::CArchive {
    std::string bytes;
    std::size_t write(const void* from, std::size_t count) override {
      bytes.append(static_cast<const char*>(from), count);
      return count;
    }
    std::size_t read(void*, std::size_t) override { return 0; }
  } archive;
  archive.WriteObject(object);
  return archive.bytes;
}

}  // namespace mapweave::rawlog
