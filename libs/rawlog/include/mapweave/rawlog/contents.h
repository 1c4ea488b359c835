#pragma once
// What a log holds, without mapping it.

#include <mapweave/rawlog/observation_stream.h>

#include <optional>
#include <string>
#include <vector>

namespace mapweave::rawlog {

// Of a laser's scans that are alike.
struct LaserGeometry {
  std::uint32_t rays = 0;
  double first_angle_rad = 0.0, last_angle_rad = 0.0;  // robot frame where the laser stands upright, counter-clockwise
  double max_range_m = 0.0;
  double x_m = 0.0, y_m = 0.0, z_m = 0.0, yaw_rad = 0.0, pitch_rad = 0.0,
         roll_rad = 0.0;  // of the sensor's fan on the robot
  std::uint64_t scans = 0;
};

// Of a camera, a stereo pair (its left one) or a depth camera (its colour one), as its last frame has it.
struct RecordedCameraGeometry {
  std::uint32_t width = 0, height = 0;  // of the picture; 0 where it cannot be looked at
  bool calibrated = false, distorted = false;
  double fx = 0.0, fy = 0.0, cx = 0.0, cy = 0.0;               // pixels
  double baseline_m = 0.0;                                     // of a stereo pair, else 0
  double nearest_m = 0.0, farthest_m = 0.0;                    // of all readings of a depth camera; 0: there are none
  double least_depth_delay_s = 0.0, most_depth_delay_s = 0.0;  // depth after colour
};

struct SensorContents {
  std::string label, class_name;  // "FLASER", "CObservation2DRangeScan"
  std::uint64_t count = 0;
  Stamp first, last;
  double rate_hz = 0.0;  // (count - 1) / (last - first); 0 for a single instant
  double longest_gap_s = 0.0;
  std::vector<LaserGeometry> geometries;  // of lasers: most frequent first
  std::optional<RecordedCameraGeometry> camera;
};

// Of the first message of a topic of point clouds.
struct CloudGeometry {
  std::uint32_t width = 0, height = 0;  // a height of more than 1: organised, a point for each pixel
  std::vector<std::string> fields;
};

// Of a ROS bag, whether it is read or not. Times are those at which messages were received.
struct TopicContents {
  std::string name, type;  // "/scan", "sensor_msgs/LaserScan"
  std::uint64_t count = 0;
  double rate_hz = 0.0;
  double longest_gap_s = 0.0;
  std::vector<std::string> frames;  // of its messages, of transforms "parent -> child"; the first 50
  std::optional<CloudGeometry> cloud;
};

struct LogContents {
  std::string format;                   // "MRPT rawlog", "TUM RGB-D folder"
  std::vector<SensorContents> sensors;  // by label, then class
  std::uint64_t observations = 0, scans = 0;
  Stamp first, last;
  double duration_s = 0.0;
  double odometry_length_m = 0.0;     // sum of steps; 0 where there is no odometry
  std::vector<TopicContents> topics;  // of a bag, by name
  std::string trouble;                // why the topics of a bag become no observations; then there are none
  std::vector<std::string> doubts;    // what is implausible of its numbers (unit_check.h), with a guess
  bool has_laser() const { return scans > 0; }
};

LogContents summarize_log(const std::filesystem::path& log, const ReadOptions& options = {});

// The format's name, without reading further than needed to know it. Throws what open_log throws.
std::string format_of_log(const std::filesystem::path& log);

// Whether the log is a folder of pictures, which is of one camera; folders of ROS bags are not.
bool is_picture_folder(const std::filesystem::path& log);

// Whether the ground truth that comes with the log follows its camera's optical frame (folders of TUM RGB-D and KITTI)
// and not the robot (EuRoC: the body of its sensor files).
bool truth_follows_camera(const std::filesystem::path& log);

}  // namespace mapweave::rawlog
