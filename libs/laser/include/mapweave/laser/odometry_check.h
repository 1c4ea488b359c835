#pragma once
// Whether odometry moves much farther than the scans do, or turns by degrees, judged by the first motions.

#include <mapweave/core/geometry.h>
#include <mapweave/maps/scan.h>
#include <mapweave/matching/scan_matcher.h>
#include <mapweave/rawlog/unit_check.h>

#include <optional>
#include <vector>

namespace mapweave::laser {

// Scans are matched to earlier ones without odometry, until it is known or was tried often enough; nothing is done
// after that. Not thread-safe.
class OdometryCheck {
 public:
  void add_odometry(const Pose2& odometry_from_robot) { odometry_from_robot_ = odometry_from_robot; }  // as recorded
  std::optional<rawlog::UnitDoubt> add_scan(Stamp stamp, const PackedScan& scan);

 private:
  struct Reference {
    Stamp stamp;
    Pose2 odometry_from_robot;
    matching::WallField field;
    double try_m, try_rad;  // what odometry has to claim for the next match
  };
  struct Turn {
    double claimed_rad, matched_rad;
  };
  void begin(Stamp stamp, const std::vector<matching::WallPoint>& points);
  std::optional<Pose2> match(const std::vector<matching::WallPoint>& points) const;
  std::optional<rawlog::UnitDoubt> doubt();

  std::optional<Pose2> odometry_from_robot_;
  std::optional<Reference> reference_;
  std::vector<double> ratios_;  // of a motion by odometry to that by the scans
  std::vector<Turn> turns_;
  bool moves_are_judged_ = false, turns_are_judged_ = false;
  int tries_ = 0;
};

}  // namespace mapweave::laser
