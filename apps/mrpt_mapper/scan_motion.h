#pragma once
// How the robot moved from scan to scan: by odometry where there is any, else by matching each scan with an earlier
// one.

#include "local_matcher.h"

#include <deque>
#include <functional>
#include <optional>

namespace mapweave::mrpt_mapper {

struct MovedScan {
  Stamp stamp;
  PackedScan scan;
  mrpt::obs::CObservation2DRangeScan::Ptr observation;
  Pose2 previous_from_this;  // identity for the first
  bool by_wheels = false;
};

// Scans leave in the order they came in, each as soon as its odometry is known: that of its own stamp, or interpolated
// between the readings around it. A scan that waits longer than a second of data time for odometry is placed by
// matching.
class ScanMotion {
 public:
  using Sink = std::function<void(const MovedScan&)>;
  explicit ScanMotion(Sink sink) : sink_(std::move(sink)) {}
  void add_odometry(Stamp, const Pose2& odometry_from_robot);
  void add_scan(Stamp, PackedScan);
  void finish();  // no more is to come

 private:
  struct Reading {
    Stamp stamp;
    Pose2 odometry_from_robot;
  };
  struct Waiting {
    Stamp stamp;
    PackedScan scan;
  };
  void release(Waiting, std::optional<Pose2> odometry_from_robot);

  Sink sink_;
  std::deque<Waiting> waiting_;
  std::optional<Reading> earlier_, latest_;  // readings; earlier_ is the one before latest_
  std::optional<Pose2> last_odometry_;       // of the last released scan, if it had any
  bool released_any_ = false;
  LocalMatcher matcher_{true};  // used, and kept, only while there is no odometry
  Pose2 last_motion_;
};

}  // namespace mapweave::mrpt_mapper
