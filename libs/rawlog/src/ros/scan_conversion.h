#pragma once
// Laser scans, clouds, inertial measurements and positions by satellites of ROS as MRPT's observations. Stamps and
// labels are set by the caller.

#include "messages.h"

#include <mapweave/rawlog/observation_stream.h>
#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/obs/CObservationGPS.h>
#include <mrpt/obs/CObservationIMU.h>
#include <mrpt/poses/CPose3D.h>

#include <memory>
#include <optional>
#include <string>

namespace mapweave::rawlog::ros {

mrpt::poses::CPose3D to_mrpt_pose(const Pose3& pose);

struct ConvertedScan {
  std::shared_ptr<mrpt::obs::CObservation2DRangeScan> scan;  // null: cannot be used
  std::string problem;                                       // of a scan that is left out, or of what is not used of it
};

// MRPT's fans lie symmetrically about the x axis, so the pose turns by the middle of the angles. Rays keep their order.
// Readings as REP 117 has them: +infinity, NaN, -infinity and what is out of the sensor's range are no returns. How
// long the sweep took is kept where time_increment says it and it can be (scan_sweep.h).
ConvertedScan to_scan(const LaserScanMessage& message, const Pose3& robot_from_sensor);

// A level planar scan of 720 rays all around, of each the nearest point: of a lidar with rings (a field "ring") those
// of one ring, else those at about the sensor's height. `ring`: the one in use, chosen by the first cloud: that of most
// level points.
// Throws Error kBadInput for a cloud without x, y, z, or whose sizes do not fit its data.
ConvertedScan to_scan(const PointCloudMessage& message, const Pose3& robot_from_sensor, const ReadOptions& options,
                      std::optional<int>& ring);

std::shared_ptr<mrpt::obs::CObservationIMU> to_imu(const ImuMessage& message, const Pose3& robot_from_sensor);

// As a GGA message of NMEA. Its fix has the quality 0 where there is none, 2 where it was corrected, else 1.
std::shared_ptr<mrpt::obs::CObservationGPS> to_gps(const PositionMessage& message, const Pose3& robot_from_sensor);

}  // namespace mapweave::rawlog::ros
