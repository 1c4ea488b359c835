#pragma once
// Recorded observations become what laser engines take: here MRPT's observations end.

#include <mapweave/laser/laser_mapper.h>
#include <mapweave/rawlog/observation_stream.h>
#include <mrpt/obs/CObservationIMU.h>

#include <map>
#include <optional>
#include <string>
#include <utility>

namespace mapweave::laser {

// How long a laser takes to turn.
enum class SweepSource {
  automatic,  // not known here: an engine may learn it from the scans
  given,      // as the options say
  none        // nothing: all rays at the stamp
};
// Whether the turns of an inertial unit are used.
enum class InertialUse { automatic, none };
// In which order the rays of a scan were measured.
enum class SweepOrder { along_rays, against_rays };

struct ScanInputOptions {
  std::string label;
  double min_range_m = 0.05;
  double max_range_m = 0.0;
  double max_speed_mps = 20.0;
  SweepSource sweep = SweepSource::automatic;
  double sweep_s = 0.0;
  SweepOrder sweep_order = SweepOrder::along_rays;
  double sweep_stamp = 0.0;
  InertialUse inertial = InertialUse::automatic;

  template <class Visitor>
  void describe(Visitor& v) {
    v.text("label", label,
           "sensor label of the laser to map with where a log has several; empty: the first one in the log");
    v.non_negative("min_range_m", min_range_m,
                   "laser readings below this distance in metres count as no return, because they show the robot's own "
                   "body; larger values drop more readings");
    v.non_negative("max_range_m", max_range_m,
                   "laser readings of this distance in metres or more count as no return; larger values keep more "
                   "readings; 0: the sensor's own maximum, at most 200 m");
    v.positive("max_speed_mps", max_speed_mps,
               "largest plausible speed of odometry in metres per second; a faster jump counts as a reset during which "
               "the robot "
               "stood still; larger values miss resets");
    v.choice("sweep", sweep,
             {{"automatic", SweepSource::automatic}, {"given", SweepSource::given}, {"none", SweepSource::none}},
             "how long the laser takes for one sweep, which distorts scans of a moving robot; automatic: the engine "
             "graph estimates it "
             "from the scans; given: as sweep_s says; none: all rays are taken at once");
    v.number("sweep_s", sweep_s, 0.0, 5.0,
             "time in seconds from the first ray of a scan to its last one (laser.scan.sweep: given); larger values "
             "undistort scans of a moving robot more");
    v.choice(
        "sweep_order", sweep_order,
        {{"along_rays", SweepOrder::along_rays}, {"against_rays", SweepOrder::against_rays}},
        "direction of the sweep; along_rays: the first ray of a scan was measured first; against_rays: the last one "
        "(laser.scan.sweep: given)");
    v.fraction("sweep_stamp", sweep_stamp,
               "which part of the sweep has passed at a scan's stamp; 0: it is stamped at the first measured ray, 1: "
               "at the last one "
               "(laser.scan.sweep: given)");
    v.choice("inertial", inertial, {{"automatic", InertialUse::automatic}, {"none", InertialUse::none}},
             "how turns of an inertial unit in the robot's log are used; automatic: the engine graph learns from the "
             "scans how far to believe them, and then predicts turns and undistorts scans by them; none: they are "
             "neither sent nor used");
  }
};

// Of one robot's log, one call per record in order. Scans of the chosen laser, odometry and turns of the first inertial
// unit (at most 25 a second; none where options say so) are answered, all else is nullopt. Invalid and
// out-of-range rays become no returns; a scan whose description makes no sense (fewer than 2 rays, an aperture or a
// sensor pose that is not finite) is left out and counted, so is odometry that is not finite. Odometry that jumps
// farther than any robot drives goes on from where it was.
class ScanPacker {
 public:
  explicit ScanPacker(ScanInputOptions options = {});
  std::optional<LaserInput> operator()(const rawlog::Record&);

  const std::string& label() const { return options_.label; }  // in use; empty before the first scan
  bool found_laser() const { return found_laser_; }            // a scan was packed
  const std::map<std::string, std::uint64_t>& ignored_lasers() const {
    return ignored_;
  }                                                     // scans of other lasers, by label
  std::uint64_t unusable() const { return unusable_; }  // records that made no sense
  std::uint64_t odometry_jumps() const { return odometry_jumps_; }
  bool found_inertial() const { return found_inertial_; }  // a unit that measures turns, used or not

 private:
  ScanInputOptions options_;
  bool found_laser_ = false, label_is_known_ = false, found_inertial_ = false;
  std::shared_ptr<const ScanGeometry> geometry_;
  std::map<std::string, std::uint64_t> ignored_;
  std::uint64_t unusable_ = 0, odometry_jumps_ = 0;
  std::optional<LaserInput> inertial(Stamp stamp, const mrpt::obs::CObservationIMU&);
  Pose2 steady(Stamp stamp, const Pose2& odometry_from_robot);
  Pose2 start_from_odometry_;
  std::optional<std::pair<Stamp, Pose2>> last_odometry_;
  struct Inertial {
    std::string label;
    Stamp stamp;
    double rate_rad_s = 0.0;
    std::optional<double> heading_rad;
    double yaw_rad = 0.0;
    std::optional<Stamp> answered;  // when it was answered last
  };
  std::optional<Inertial> inertial_;
};

}  // namespace mapweave::laser
