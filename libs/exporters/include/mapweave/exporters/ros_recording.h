#pragma once
// Maps as recordings of ROS: what RViz, Foxglove and Lichtblick show.

#include <mapweave/exporters/point_cloud.h>
#include <mapweave/maps/map.h>

#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace mapweave::exporters {

struct RecordedMap {
  const Map* map = nullptr;
  const OccupancyGrid* grid = nullptr;  // null, or without cells: none is written
  std::vector<ColouredPoint> points;    // in the map's frame, metres; may be empty
};

// All is in the map's frame, `map` (of a team: the team's). Of several maps each has a frame of its own, maps/ID/map,
// and topics /maps/ID/map and /maps/ID/points.
//   /map         nav_msgs/OccupancyGrid    the grid's cells: 100 wall, 0 free, -1 unknown
//   /points      sensor_msgs/PointCloud2   x, y, z, rgb
//   /ROBOT/path  nav_msgs/Path             every pose of a robot
//   /tf_static   tf2_msgs/TFMessage        map -> ROBOT/map, where that robot stood first
//   /tf          tf2_msgs/TFMessage        ROBOT/map -> ROBOT/base_link, at each of its poses
// Maps, points and paths are recorded at the time of the first pose, latched. Letters that ROS allows in no name become
// '_'. Contract: poses are finite.

// A bag of ROS 1 (version 2.0, not compressed). Throws Error kBadInput for stamps that ROS 1 cannot hold: before 1970,
// after 2106.
std::string ros1_bag_bytes(const std::vector<RecordedMap>&);
// An MCAP file of profile ros2: CDR, chunks compressed by zstd. Throws Error kBadInput for stamps before 1970 or after
// 2038.
std::string ros2_mcap_bytes(const std::vector<RecordedMap>&);

// A name as ROS allows it in topics and frames: letters, digits and '_', a letter first. Other letters become '_', and
// 'r' goes before what is no letter.
std::string ros_name(std::string_view text);
// ros_name(), with a number behind it where that is taken already; it is taken then.
std::string unique_ros_name(std::string_view text, std::set<std::string>& taken);

}  // namespace mapweave::exporters
