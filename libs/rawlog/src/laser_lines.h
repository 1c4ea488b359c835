#pragma once
// The lines that CARMEN and g2o logs share: FLASER, RLASER (CARMEN's old style) and ROBOTLASER1, ROBOTLASER2, ... (new
// style).

#include "record_source.h"
#include "text_lines.h"

#include <mapweave/core/geometry.h>

#include <map>
#include <optional>

namespace mapweave::rawlog {

struct LaserLine {
  std::string label;            // the line's first field
  std::vector<float> ranges;    // metres; infinite: no return
  bool geometry_given = false;  // new style
  double first_angle_rad = 0.0, field_of_view_rad = 0.0, resolution_rad = 0.0, max_range_m = 0.0;
  Pose2 world_from_laser, world_from_robot;
  double ipc_stamp_s = 0.0, logger_stamp_s = 0.0;
};

bool is_laser_keyword(std::string_view keyword);
// `line` is reused: its ranges keep their memory. Throws Error kBadInput or kCorrupt with file and line.
void parse_laser_line(std::string_view keyword, Fields& fields, LaserLine& line);

// What a log does not say about a laser, found by looking at all of its lines first.
struct LaserTraits {
  double max_range_m = 0.0;  // readings at or past it are no returns
  Pose2 robot_from_laser;
};

class LaserSurvey {
 public:
  void add(const LaserLine& line);
  void add_parameter(std::string_view name, double value);  // CARMEN's PARAM lines
  bool uses_logger_stamps() const;                          // the ipc stamps stand still
  bool has_usable_stamps() const;  // positive; they never go back, and advance where there are several
  bool poses_move() const { return poses_move_; }
  LaserTraits traits(const std::string& label, const ReadOptions& options) const;
  std::optional<double> resolution_rad(bool rear) const;

 private:
  struct Sensor {
    std::vector<std::uint64_t> centimetres;  // how many readings of so many centimetres
    double longest_m = 0.0, stated_max_m = 0.0;
    std::vector<Pose2> robot_from_laser;
  };
  struct Stamps {
    double last = 0.0;
    std::uint64_t count = 0, advances = 0, returns = 0;
    bool positive = true;
    void add(double stamp, bool first);
  };
  std::map<std::string, Sensor> sensors_;
  std::map<std::string, double, std::less<>> parameters_;
  Stamps ipc_, logger_;
  bool first_ = true, poses_move_ = false;
  Pose2 first_pose_;
};

// Makes observations of lines. Old-style lines do not hold their rays' angles: 180, 181, 360, 361, 720 or 721 rays
// span 180 deg with ray 0 at -90 deg; of an even number the last stands one step short of +90 deg (CARMEN's and
// GMapping's habit).
class LaserLineConverter {
 public:
  LaserLineConverter(const LaserSurvey& survey, const ReadOptions& options) : survey_(survey), options_(options) {}
  PlacedRecord scan(const LaserLine& line, Stamp stamp, std::uint64_t place);

 private:
  const LaserSurvey& survey_;
  ReadOptions options_;
  std::map<std::string, LaserTraits> traits_;
  std::vector<char> valid_;
};

PlacedRecord odometry_record(const Pose2& odometry_from_robot, Stamp stamp, std::uint64_t place);

// The one of a line's two stamps that `survey` chose. To the microsecond, as these logs write it: a double of seconds
// since 1970 holds no more. Throws Error kBadInput where it is no time.
Stamp stamp_of_line(const LaserSurvey& survey, double ipc_stamp_s, double logger_stamp_s, const Fields& fields);
Stamp stamp_of_text(double seconds, const Fields& fields);

}  // namespace mapweave::rawlog
