#pragma once
// Any recording becomes one stream of MRPT observations in the order of their stamps.

#include <mapweave/core/stamp.h>
#include <mrpt/core/Clock.h>
#include <mrpt/obs/CObservation.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>

namespace mapweave::rawlog {

struct Record {
  Stamp stamp;
  mrpt::obs::CObservation::Ptr observation;  // never null; its timestamp is `stamp`
};

// Not thread-safe. What was answered before an Error is good, and the stream ends with the Error.
class ObservationStream {
 public:
  // The next record, in the order of stamps: of equal stamps odometry comes first, else the order of the file. nullopt at the clean end.
  // Throws Error: kCorrupt for bytes that cannot be decoded, kBadInput for what was decoded and cannot be used (NaN ranges, a scan
  // of no rays, a log of no observations, time running backwards), kUnsupported for a class that MRPT does not know.
  virtual std::optional<Record> next() = 0;
  // Of the file as it lies on the disk, that is compressed: for progress.
  virtual std::uint64_t bytes_read() const = 0;
  virtual std::uint64_t bytes_total() const = 0;
  virtual ~ObservationStream() = default;
};

struct ReadOptions {
  double reorder_window_s = 0.5;
  double max_object_mb = 256.0;
  double laser_x_m = 0.0;
  double laser_y_m = 0.0;
  double laser_yaw_rad = 0.0;
  double max_range_m = 0.0;
  double scan_rate_hz = 2.0;
  double max_pair_s = 0.02;

  template <class Visitor>
  void describe(Visitor& v) {
    v.non_negative("reorder_window_s", reorder_window_s, "records that come late by up to this are sorted in; later ones are an error");
    v.positive("max_object_mb", max_object_mb, "rawlog: an object of more bytes is taken for damage");
    v.number("laser_x_m", laser_x_m, -100.0, 100.0, "CARMEN, g2o: laser ahead of the robot's origin, where the log does not say");
    v.number("laser_y_m", laser_y_m, -100.0, 100.0, "CARMEN, g2o: laser left of the robot's origin, where the log does not say");
    v.number("laser_yaw_rad", laser_yaw_rad, -7.0, 7.0, "CARMEN, g2o: heading of the laser on the robot, where the log does not say");
    v.non_negative("max_range_m", max_range_m, "CARMEN, g2o: readings at or past it are no returns; 0: found from the log");
    v.positive("scan_rate_hz", scan_rate_hz, "g2o: scans per second of the stamps given to a log that has none");
    v.number("max_pair_s", max_pair_s, 0.0, 1.0, "folders: colour and depth pictures this far apart or further are not one frame");
  }
};

// The format is known by the content first, then by the extension; gz is undone where it is found. Throws Error: kMissing, kBadInput
// for an empty file, kUnsupported (naming the formats that are read) for anything unknown.
std::unique_ptr<ObservationStream> open_log(const std::filesystem::path& path, const ReadOptions& options = {});

// Loads what an observation keeps in files beside the log (cameras, depth cameras). Throws Error kMissing, naming the file, or kCorrupt.
void load_pictures(const mrpt::obs::CObservation& observation);

// Whether MRPT has set the time, to one that a Stamp can hold.
bool has_stamp(mrpt::Clock::time_point time);
// MRPT counts in steps of 100 ns, so a stamp that came from elsewhere loses up to 50 ns on its way there.
Stamp to_stamp(mrpt::Clock::time_point time);  // contract: has_stamp(time)
mrpt::Clock::time_point to_mrpt_time(Stamp stamp);

}  // namespace mapweave::rawlog
