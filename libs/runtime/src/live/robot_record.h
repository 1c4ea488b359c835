#pragma once
// What an edge says of a robot that has ended, beside its maps, for the folder of results, and what a robot that maps
// on board says to its edge. As JSON.

#include <mapweave/runtime/robot_task.h>

#include <string>
#include <string_view>
#include <vector>

namespace mapweave::runtime {

struct RobotRecord {
  RobotId robot;
  std::optional<Error> trouble;
  std::uint64_t scans = 0, lost_scans = 0, sensed_bytes = 0, map_bytes = 0;
  double log_s = 0.0, mapping_s = 0.0, helper_s = 0.0, wall_s = 0.0;  // log: of data; the next two of processor time
  std::vector<std::string> notes;
  std::string log;  // where it was recorded; empty: not said
  Hash log_sha256;
  std::string sensor;             // "laser"
  std::vector<StampedPose> live;  // where it was, as it came (LivePose)
  std::vector<StampedPose> odometry;
  std::optional<CamerasOutcome> cameras;  // of a robot that maps with them: its maps by their ids alone
  // Of a robot that maps with a laser, too: whether its first map is the laser's. `trouble` is then that of the laser.
  std::optional<bool> has_laser_map;
  std::optional<Error> camera_trouble;
};

// The name under which a robot's maps travel: its own, then "NAME.1" and so on.
MapId name_of_map(const RobotId& robot, std::size_t number);

std::string encode(const RobotRecord& record);
// Throws Error kCorrupt or kBadInput for what is not sound.
RobotRecord decode_robot_record(std::string_view bytes, const std::string& where);

// As a task of this process would have left it. maps: none where it left none.
RobotResult result_of(RobotRecord record, std::vector<Map> maps, const PlannedRobot& robot,
                      const RunConfiguration& configuration);

}  // namespace mapweave::runtime
