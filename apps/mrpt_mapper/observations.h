#pragma once
// Packed scans as MRPT's engines want them.

#include <mapweave/core/stamp.h>
#include <mapweave/maps/scan.h>
#include <mrpt/maps/CSimplePointsMap.h>
#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/slam/CICP.h>

#include <mapweave/laser/mrpt_options.h>

namespace mapweave::mrpt_mapper {

// MRPT's fan is symmetric about the sensor's x axis: the sensor is turned so that every ray keeps its direction. The
// sensor is laid flat (MRPT's planar maps refuse tilted ones), upside down where it hangs so.
mrpt::obs::CObservation2DRangeScan::Ptr observation_of(const PackedScan&, Stamp);

int returns_in(const PackedScan&);

mrpt::slam::CICP::TConfigParams icp_parameters(const laser::IcpSearchOptions&);

// The scan's points in the robot frame.
mrpt::maps::CSimplePointsMap points_of(const mrpt::obs::CObservation2DRangeScan&, double point_distance_m);

}  // namespace mapweave::mrpt_mapper
