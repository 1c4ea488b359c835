#pragma once
// Relation error: how well relative poses of a trajectory agree with relations that people checked by hand. Independent
// of any global frame, and so fair to maps whose far ends bend. Kuemmerle et al., "On measuring the accuracy of SLAM
// algorithms", Autonomous Robots 27 (2009) 387-407.

#include <mapweave/evaluation/trajectory.h>

#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace mapweave::evaluation {

struct Relation {
  Stamp stamp_i, stamp_j;
  Pose2 i_from_j;
};

// Text, one relation a line: `t_i t_j x y z roll pitch yaw` (seconds, metres, radians); `#` starts a comment. The
// metric is planar: z, roll and pitch must be numbers and are not used. Throws Error, with the line; also for a file
// without relations.
std::vector<Relation> parse_relations(std::string_view text, const std::string& where);
std::vector<Relation> read_relations(const std::filesystem::path&);

struct RelationErrorOptions {
  Pose2 robot_from_sensor;           // where relations speak of the sensor and the trajectory of the robot
  double stamp_tolerance_s = 0.001;  // a pose this near is the pose at the stamp
  double max_gap_s = 2.0;            // where there is none, poses this far apart are interpolated
  template <class Visitor>
  void describe(Visitor& v) {
    v.number("sensor_x_m", robot_from_sensor.x, -100.0, 100.0,
             "distance in metres, ahead of the robot's origin, of the sensor whose motion the relations give");
    v.number("sensor_y_m", robot_from_sensor.y, -100.0, 100.0,
             "distance in metres, to the left of the robot's origin, of the sensor whose motion the relations give");
    v.number("sensor_yaw_rad", robot_from_sensor.phi, -3.2, 3.2,
             "heading on the robot in radians, counter-clockwise, of the sensor whose motion the relations give");
    v.non_negative("stamp_tolerance_s", stamp_tolerance_s,
                   "largest difference in seconds between the stamps of a relation and of a pose at which the pose is "
                   "taken as it is; larger values interpolate fewer poses");
    v.non_negative("max_gap_s", max_gap_s,
                   "longest gap in seconds between two poses in which a pose is interpolated for a relation's stamp; "
                   "larger values use more relations; 0: none is interpolated");
  }
};

// Means over the used relations of |e.xy| and |e.yaw|, e = (i_from_j of the relation)^-1 (+) (i_from_j of the
// trajectory).
struct RelationError {
  std::size_t count = 0;           // relations given
  std::size_t used = 0;            // of which the trajectory had both poses
  std::size_t interpolated = 0;    // of the used: with an interpolated pose
  std::size_t between_robots = 0;  // of the used: from one robot's pose to another's
  double translation_mean_m = 0.0, translation_std_m = 0.0, translation_median_m = 0.0, translation_max_m = 0.0;
  double rotation_mean_deg = 0.0, rotation_std_deg = 0.0, rotation_median_deg = 0.0, rotation_max_deg = 0.0;
  double translation_squared_mean = 0.0, translation_squared_std = 0.0;  // m^2
  double rotation_squared_mean = 0.0, rotation_squared_std = 0.0;        // deg^2
};

// Throws Error(kBadInput) where no relation can be used: there is no error to speak of.
RelationError relation_error(const Trajectory&, const std::vector<Relation>&, const RelationErrorOptions& = {});

// Relations, and the robots of one or several maps whose they may be. One is looked for in each robot's trajectory, in
// their order, and then between the robots of a map; never between maps.
struct TeamRelations {
  std::vector<std::vector<Trajectory>> maps;
  std::vector<Relation> relations;
};

// Of all of them together.
RelationError relation_error(const std::vector<TeamRelations>&, const RelationErrorOptions& = {});

}  // namespace mapweave::evaluation
