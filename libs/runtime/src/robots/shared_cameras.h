#pragma once
// Robots' cameras that publish to their edge's map server what they see while they see it, and receive what others
// know: by data time, so that neither threads nor the order of robots change a byte. Edges pass on what they receive to
// the others, through the cloud; it is there at the next moment.

#include <mapweave/runtime/camera_task.h>
#include <mapweave/tiers/camera_agent.h>

#include <cstdint>
#include <map>
#include <optional>
#include <string>

namespace mapweave::runtime {

// Of the robots that have cameras to map with; the others, and those whose logs cannot be read, are left to
// map_robot(), which says so. `starts`: maps of sessions before, which every map server has from the start. Throws
// Interrupted alone.
std::map<RobotId, CamerasOutcome> map_shared_cameras(const RunConfiguration&, const RunPlan&,
                                                     const std::vector<Map>& starts, bool keep_going, WorkerPool&,
                                                     Progress&);

// What a camera has sent, received and seen of others so far. second: of data, since the first exchange.
void count_sharing(const visual::VisualClient&, const tiers::CameraAgent&, std::uint64_t second, CameraReport&);

// What somebody who asked for sharing should know: that there is nobody to share with, or that cameras of different
// edges share nothing (server.across_edges). shares_alone: a camera alone is given something too, of what it forgot or
// of maps of sessions before. After choose_sensors().
std::optional<std::string> note_on_sharing(const RunConfiguration&, const RunPlan&, bool shares_alone);

}  // namespace mapweave::runtime
