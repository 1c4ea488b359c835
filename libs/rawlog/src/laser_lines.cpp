#include "laser_lines.h"

#include <mapweave/core/median.h>
#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/obs/CObservationOdometry.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

namespace mapweave::rawlog {
namespace {

constexpr std::size_t kMostRays = 100'000, kMostPosesKept = 20'000;
constexpr double kDegree = M_PI / 180.0;
constexpr double kUsualMaximum = 81.0;  // m, of a SICK LMS; it answers 81.83 to 81.91 for "nothing there"
constexpr const char* kOdometryLabel = "ODOM";

bool is_rear(std::string_view label) { return label == "RLASER"; }

Pose2 parse_pose(Fields& fields, const char* x, const char* y, const char* heading) {
  Pose2 pose;
  pose.x = fields.number(x);
  pose.y = fields.number(y);
  pose.phi = wrap_angle(fields.number(heading));
  return pose;
}

void parse_ranges(Fields& fields, std::vector<float>& ranges) {
  const std::size_t rays = fields.count("the number of readings", kMostRays);
  if (rays == 0) throw fields.error("the scan has no readings; at least one was expected");
  ranges.resize(rays);
  for (float& range : ranges) {
    const double value = fields.any_number("a range");
    if (std::isnan(value)) throw fields.error("a range is not a number");
    if (value < 0.0) throw fields.error("the range " + std::to_string(value) + " m is negative");
    range = value > 1e9 ? std::numeric_limits<float>::infinity() : static_cast<float>(value);
  }
}

struct Fan {
  double first_rad, step_rad;
};

Fan fan_of(const LaserLine& line, std::optional<double> stated_resolution_rad) {
  const auto rays = static_cast<double>(line.ranges.size());
  if (line.geometry_given) {
    // Rounded in the log; the field of view is written with one step more or less.
    double step = line.resolution_rad;
    for (const double exact : {line.field_of_view_rad / rays, line.field_of_view_rad / std::max(1.0, rays - 1.0)}) {
      if (step <= 0.0 || std::abs(exact - line.resolution_rad) < std::abs(line.resolution_rad) * 1e-3) {
        step = exact;
        break;
      }
    }
    return {line.first_angle_rad, step};
  }
  const bool even = line.ranges.size() % 2 == 0;
  const double steps = std::max(1.0, even ? rays : rays - 1.0);
  double field_of_view = M_PI;
  if (steps == 540.0 || steps == 1080.0) {
    field_of_view = 1.5 * M_PI;
  } else if (steps != 180.0 && steps != 360.0 && steps != 720.0 && stated_resolution_rad &&
             steps * *stated_resolution_rad <= 2.0 * M_PI + 1e-9) {
    field_of_view = steps * *stated_resolution_rad;
  }
  return {-0.5 * field_of_view, field_of_view / steps};
}

double rounded(double value) { return std::round(value * 1e4) / 1e4 + 0.0; }  // never -0

// The laser's extrinsics that nearly all lines agree on; nullopt where they do not (a corrected laser pose beside raw
// odometry).
std::optional<Pose2> agreed(const std::vector<Pose2>& poses) {
  if (poses.empty()) return std::nullopt;
  std::vector<double> x, y, turn;
  for (const Pose2& pose : poses) {
    x.push_back(pose.x);
    y.push_back(pose.y);
    turn.push_back(wrap_angle(pose.phi - poses.front().phi));  // away from the seam
  }
  const Pose2 middle(median(x), median(y), wrap_angle(poses.front().phi + median(turn)));
  const auto near = std::count_if(poses.begin(), poses.end(), [&](const Pose2& pose) {
    return std::hypot(pose.x - middle.x, pose.y - middle.y) < 0.02 &&
           std::abs(wrap_angle(pose.phi - middle.phi)) < 0.01;
  });
  if (static_cast<double>(near) < 0.9 * static_cast<double>(poses.size())) return std::nullopt;
  return Pose2(rounded(middle.x), rounded(middle.y), rounded(middle.phi));
}

}  // namespace

bool is_laser_keyword(std::string_view keyword) {
  return keyword == "FLASER" || keyword == "RLASER" || (keyword.size() == 11 && keyword.substr(0, 10) == "ROBOTLASER");
}

void parse_laser_line(std::string_view keyword, Fields& fields, LaserLine& line) {
  line.label.assign(keyword);
  line.geometry_given = keyword.substr(0, 5) == "ROBOT";
  if (line.geometry_given) {
    fields.number("the laser's type");
    line.first_angle_rad = fields.number("the first ray's angle");
    line.field_of_view_rad = fields.number("the field of view");
    line.resolution_rad = fields.number("the angular resolution");
    line.max_range_m = fields.number("the maximum range");
    fields.number("the accuracy");
    fields.number("the remission mode");
  }
  parse_ranges(fields, line.ranges);
  if (line.geometry_given) {
    const std::size_t remissions = fields.count("the number of remissions", kMostRays);
    for (std::size_t i = 0; i < remissions; ++i) fields.any_number("a remission");
  }
  line.world_from_laser = parse_pose(fields, "the laser's x", "the laser's y", "the laser's heading");
  line.world_from_robot = parse_pose(fields, "the robot's x", "the robot's y", "the robot's heading");
  if (line.geometry_given) {
    for (const char* name :
         {"the speed", "the turn rate", "the forward safety distance", "the side safety distance", "the turn axis"})
      fields.any_number(name);
  }
  line.ipc_stamp_s = fields.number("the ipc stamp");
  fields.text("the host's name");
  line.logger_stamp_s = fields.number("the logger's stamp");
  fields.expect_end("the line");
}

void LaserSurvey::Stamps::add(double stamp, bool first) {
  if (!first) {
    advances += stamp > last;
    returns += stamp < last;
  }
  positive = positive && stamp > 0.0;
  ++count;
  last = stamp;
}

void LaserSurvey::add(const LaserLine& line) {
  Sensor& sensor = sensors_[line.label];
  for (const float range : line.ranges) {
    if (!(range <= 1000.0f)) continue;
    const auto bin = static_cast<std::size_t>(std::lround(range * 100.0f));
    if (bin >= sensor.centimetres.size()) sensor.centimetres.resize(bin + 1);
    ++sensor.centimetres[bin];
    sensor.longest_m = std::max(sensor.longest_m, static_cast<double>(range));
  }
  if (line.geometry_given) sensor.stated_max_m = std::max(sensor.stated_max_m, line.max_range_m);
  if (sensor.robot_from_laser.size() < kMostPosesKept)
    sensor.robot_from_laser.push_back(between(line.world_from_robot, line.world_from_laser));
  if (first_) first_pose_ = line.world_from_robot;
  const Pose2 moved = between(first_pose_, line.world_from_robot);
  poses_move_ = poses_move_ || std::hypot(moved.x, moved.y) > 1e-3 || std::abs(moved.phi) > 1e-3;
  ipc_.add(line.ipc_stamp_s, first_);
  logger_.add(line.logger_stamp_s, first_);
  first_ = false;
}

void LaserSurvey::add_parameter(std::string_view name, double value) {
  parameters_.insert_or_assign(std::string(name), value);
}

bool LaserSurvey::uses_logger_stamps() const { return 2 * ipc_.advances < logger_.advances; }

bool LaserSurvey::has_usable_stamps() const {
  const Stamps& stamps = uses_logger_stamps() ? logger_ : ipc_;
  return stamps.positive && stamps.returns == 0 && (stamps.advances > 0 || stamps.count == 1);
}

std::optional<double> LaserSurvey::resolution_rad(bool rear) const {
  for (const char* name : rear ? std::array{"laser_rear_laser_resolution", "laser_rearlaser_resolution"}
                               : std::array{"laser_front_laser_resolution", "laser_frontlaser_resolution"}) {
    const auto found = parameters_.find(name);
    if (found != parameters_.end() && found->second > 0.0 && found->second <= 10.0) return found->second * kDegree;
  }
  return std::nullopt;
}

LaserTraits LaserSurvey::traits(const std::string& label, const ReadOptions& options) const {
  LaserTraits traits;
  const auto found = sensors_.find(label);
  if (found == sensors_.end()) return traits;
  const Sensor& sensor = found->second;

  // Lasers answer one value, or a few close by, where nothing came back: a heap of readings at the far end of all.
  traits.max_range_m = options.max_range_m;
  if (traits.max_range_m <= 0.0) {
    const auto readings_between = [&](double low_m, double high_m) {
      std::uint64_t count = 0;
      for (auto i = static_cast<std::size_t>(low_m * 100.0);
           i < sensor.centimetres.size() && static_cast<double>(i) <= high_m * 100.0; ++i)
        count += sensor.centimetres[i];
      return count;
    };
    const double longest = sensor.longest_m;
    const auto heap = readings_between(0.99 * longest, longest),
               before = readings_between(0.97 * longest, 0.98 * longest);
    if (heap >= 20 && heap >= 10 * before) {
      traits.max_range_m = std::floor(0.99 * longest * 2.0) / 2.0;
    } else {
      traits.max_range_m = longest <= 81.92 ? kUsualMaximum : std::ceil(longest) + 1.0;
    }
    if (sensor.stated_max_m > 0.0) traits.max_range_m = std::min(traits.max_range_m, sensor.stated_max_m);
  }

  const Pose2 stated(options.laser_x_m, options.laser_y_m, options.laser_yaw_rad);
  const bool rear = is_rear(label);
  const auto parameter = [&](const char* front, const char* back) {
    const auto value = parameters_.find(rear ? back : front);
    return value == parameters_.end() ? std::optional<double>{} : value->second;
  };
  const auto offset = agreed(sensor.robot_from_laser);
  const bool offset_says_nothing = offset && offset->x == 0.0 && offset->y == 0.0 && offset->phi == 0.0;
  if (offset && !offset_says_nothing) {
    traits.robot_from_laser = *offset;
  } else if (stated.x != 0.0 || stated.y != 0.0 || stated.phi != 0.0) {
    traits.robot_from_laser = stated;
  } else {
    traits.robot_from_laser.phi = rear ? wrap_angle(M_PI) : 0.0;
    if (!offset) {
      traits.robot_from_laser.x = parameter("robot_frontlaser_offset", "robot_rearlaser_offset").value_or(0.0);
      traits.robot_from_laser.y =
          parameter("robot_frontlaser_side_offset", "robot_rearlaser_side_offset").value_or(0.0);
      traits.robot_from_laser.phi +=
          parameter("robot_frontlaser_angular_offset", "robot_rearlaser_angular_offset").value_or(0.0);
    }
  }
  return traits;
}

PlacedRecord LaserLineConverter::scan(const LaserLine& line, Stamp stamp, std::uint64_t place) {
  auto known = traits_.find(line.label);
  if (known == traits_.end()) known = traits_.emplace(line.label, survey_.traits(line.label, options_)).first;
  const LaserTraits& traits = known->second;
  const Fan fan = fan_of(line, survey_.resolution_rad(is_rear(line.label)));
  const double aperture = fan.step_rad * static_cast<double>(line.ranges.size() - 1);

  auto scan = std::make_shared<mrpt::obs::CObservation2DRangeScan>();
  scan->sensorLabel = line.label;
  scan->timestamp = to_mrpt_time(stamp);
  scan->rightToLeft = aperture >= 0.0;
  scan->aperture = static_cast<float>(std::abs(aperture));
  scan->maxRange = static_cast<float>(traits.max_range_m);
  // MRPT's fans are symmetric about the sensor's x axis: the middle of the rays is its heading.
  const double middle = traits.robot_from_laser.phi + fan.first_rad + 0.5 * aperture;
  scan->sensorPose = mrpt::poses::CPose3D(traits.robot_from_laser.x, traits.robot_from_laser.y, 0.0, middle, 0.0, 0.0);
  valid_.resize(line.ranges.size());
  std::transform(line.ranges.begin(), line.ranges.end(), valid_.begin(),
                 [&](float range) { return static_cast<char>(range > 0.0f && range < scan->maxRange); });
  scan->loadFromVectors(line.ranges.size(), line.ranges.data(), valid_.data());
  return {{stamp, scan}, place};
}

PlacedRecord odometry_record(const Pose2& odometry_from_robot, Stamp stamp, std::uint64_t place) {
  auto odometry = std::make_shared<mrpt::obs::CObservationOdometry>();
  odometry->sensorLabel = kOdometryLabel;
  odometry->timestamp = to_mrpt_time(stamp);
  odometry->odometry = mrpt::poses::CPose2D(odometry_from_robot);
  return {{stamp, odometry}, place};
}

Stamp stamp_of_text(double seconds, const Fields& fields) {
  if (!(std::abs(seconds) < 4e9))
    throw fields.error("the stamp " + std::to_string(seconds) +
                       " s is no time; seconds since 1970 or since the start were expected");
  return Stamp{std::llround(seconds * 1e6) * 1000};
}

Stamp stamp_of_line(const LaserSurvey& survey, double ipc_stamp_s, double logger_stamp_s, const Fields& fields) {
  if (!survey.uses_logger_stamps()) return stamp_of_text(ipc_stamp_s, fields);
  if (!fields.terminated()) {  // the last number of the file, and it matters
    throw Error(ErrorCode::kCorrupt, "the file ends within this line; a line break was expected", fields.place(),
                "copy the log again, or end the line");
  }
  return stamp_of_text(logger_stamp_s, fields);
}

}  // namespace mapweave::rawlog
