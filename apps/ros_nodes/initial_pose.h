#pragma once
// A pose that a user gives of a robot that drives, as what is known of where it began.

#include <mapweave/runtime/live_preview.h>
#include <mapweave/runtime/live_requests.h>

namespace mapweave::ros_nodes {

struct GivenPose {
  RobotId robot;
  Pose2 team_from_robot;  // now, in the frame of the largest part of the preview
  double sigma_m = runtime::kStartSigma_m, sigma_rad = 0.1;
};

// The starts that say it: the robot's own, and that of the first robot of the largest part, to which it is a pose.
// Throws Error(kBadInput) where the preview shows no other robot yet.
void add_pose(const GivenPose& pose, const runtime::LivePreview& preview,
              const runtime::RunConfiguration& configuration, runtime::LiveRequests& requests);

}  // namespace mapweave::ros_nodes
