#pragma once
// The trajectories of a team's robots by their cameras' frames: fusion moves keyframes, and each frame moves with the
// keyframes around it.

#include <mapweave/exporters/session_trajectories.h>
#include <mapweave/fusion/fuse.h>
#include <mapweave/runtime/camera_task.h>

namespace mapweave::runtime {

// Of each member's robot, by its own options; of keyframes alone where `cameras` do not hold a member (stored maps).
std::vector<exporters::SessionTrajectory> team_trajectories(const fusion::Component& component,
                                                            const std::vector<CamerasOutcome>& cameras,
                                                            const RunConfiguration& configuration);

// One camera's frames in the team's map. `scale`: by which the member was rescaled.
std::vector<StampedPose> carried_along(const CameraMap& part, const FrameTrajectory& trajectory, const Map& team,
                                       double scale);

bool has_keyframes(const Map&);

}  // namespace mapweave::runtime
