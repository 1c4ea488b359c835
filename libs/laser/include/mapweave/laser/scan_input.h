#pragma once
// Recorded observations become what laser engines take: here MRPT's observations end.

#include <mapweave/laser/laser_mapper.h>
#include <mapweave/rawlog/observation_stream.h>

#include <map>
#include <optional>
#include <string>
#include <utility>

namespace mapweave::laser {

struct ScanInputOptions {
  std::string label;
  double min_range_m = 0.05;
  double max_range_m = 0.0;
  double max_speed_mps = 20.0;

  template <class Visitor>
  void describe(Visitor& v) {
    v.text("label", label, "sensor label of the laser to use where a log has several; empty: the first one seen");
    v.non_negative("min_range_m", min_range_m, "nearer readings are no returns (the robot's own body)");
    v.non_negative("max_range_m", max_range_m, "readings at or past it are no returns; 0: the log's own maximum, 200 m at most");
    v.positive("max_speed_mps", max_speed_mps,
               "odometry that jumps farther started anew: the robot is taken to have stood still meanwhile");
  }
};

// Of one robot's log, one call per record in order. Scans of the chosen laser and odometry are answered, all else is nullopt. Invalid
// and out-of-range rays become no returns; a scan whose description makes no sense (fewer than 2 rays, an aperture or a sensor pose
// that is not finite) is left out and counted, so is odometry that is not finite. Odometry that jumps farther than any robot drives goes on
// from where it was.
class ScanPacker {
 public:
  explicit ScanPacker(ScanInputOptions options = {});
  std::optional<LaserInput> operator()(const rawlog::Record&);

  const std::string& label() const { return options_.label; }                              // in use; empty before the first scan
  bool found_laser() const { return found_laser_; }                                        // a scan was packed
  const std::map<std::string, std::uint64_t>& ignored_lasers() const { return ignored_; }  // scans of other lasers, by label
  std::uint64_t unusable() const { return unusable_; }                                     // records that made no sense
  std::uint64_t odometry_jumps() const { return odometry_jumps_; }

 private:
  ScanInputOptions options_;
  bool found_laser_ = false, label_is_known_ = false;
  std::shared_ptr<const ScanGeometry> geometry_;
  std::map<std::string, std::uint64_t> ignored_;
  std::uint64_t unusable_ = 0, odometry_jumps_ = 0;
  Pose2 steady(Stamp stamp, const Pose2& odometry_from_robot);
  Pose2 start_from_odometry_;
  std::optional<std::pair<Stamp, Pose2>> last_odometry_;
};

}  // namespace mapweave::laser
