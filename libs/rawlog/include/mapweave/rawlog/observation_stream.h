#pragma once
// Any recording becomes one stream of MRPT observations in the order of their stamps.

#include <mapweave/core/stamp.h>
#include <mrpt/core/Clock.h>
#include <mrpt/obs/CObservation.h>

#include <cstdint>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace mapweave::rawlog {

struct Record {
  Stamp stamp;
  mrpt::obs::CObservation::Ptr observation;  // never null; its timestamp is `stamp`
};

// Not thread-safe. What was answered before an Error is good, and the stream ends with the Error.
class ObservationStream {
 public:
  // The next record, in the order of stamps: of equal stamps odometry comes first, else the order of the file. nullopt
  // at the clean end. Throws Error: kCorrupt for bytes that cannot be decoded, kBadInput for what was decoded and
  // cannot be used (NaN ranges, a scan of no rays, a log of no observations, time running backwards), kUnsupported for
  // a class that MRPT does not know.
  virtual std::optional<Record> next() = 0;
  // Of the file as it lies on the disk, that is compressed: for progress.
  virtual std::uint64_t bytes_read() const = 0;
  virtual std::uint64_t bytes_total() const = 0;
  virtual ~ObservationStream() = default;
};

// What point clouds of a ROS bag become.
enum class PointCloudUse { automatic, scans, depth };

struct ReadOptions {
  double reorder_window_s = 0.5;
  double max_object_mb = 256.0;
  double laser_x_m = 0.0;
  double laser_y_m = 0.0;
  double laser_yaw_rad = 0.0;
  double max_range_m = 0.0;
  double scan_rate_hz = 2.0;
  double max_pair_s = 0.02;
  std::vector<std::string> topics;
  std::string robot_namespace, robot_frame;
  bool use_tf = true, follow = false;
  PointCloudUse point_clouds = PointCloudUse::automatic;
  int cloud_ring = -1;
  double cloud_low_m = -0.2;
  double cloud_high_m = 0.2;

  template <class Visitor>
  void describe(Visitor& v) {
    v.non_negative("reorder_window_s", reorder_window_s,
                   "records of a log that are out of order by up to this time in seconds are sorted; larger values "
                   "accept worse logs and need more memory; records that are later than that are an error; of a "
                   "recording that still grows a record waits at most so long for older ones");
    v.positive("max_object_mb", max_object_mb,
               "an object in a rawlog of more than this size in megabytes is treated as damage, so that a broken "
               "length cannot exhaust memory; larger values accept larger objects");
    v.number("laser_x_m", laser_x_m, -100.0, 100.0,
             "distance in metres of the laser ahead of the robot's origin, for CARMEN and g2o logs, and ROS bags, that "
             "do not give it");
    v.number("laser_y_m", laser_y_m, -100.0, 100.0,
             "distance in metres of the laser to the left of the robot's origin, for CARMEN and g2o logs, and ROS "
             "bags, that do not give it");
    v.number("laser_yaw_rad", laser_yaw_rad, -7.0, 7.0,
             "heading of the laser on the robot in radians, counter-clockwise, for CARMEN and g2o logs, and ROS bags, "
             "that do not give it");
    v.non_negative("max_range_m", max_range_m,
                   "laser readings of this distance in metres or more count as no return in CARMEN and g2o logs; "
                   "larger values keep more readings; 0: the maximum is found from the log");
    v.positive(
        "scan_rate_hz", scan_rate_hz,
        "scans per second by which a g2o log without time stamps is stamped; larger values make its recording shorter");
    v.number("max_pair_s", max_pair_s, 0.0, 1.0,
             "colour and depth, or left and right pictures of a folder or bag belong to one frame when their stamps "
             "differ by less than this "
             "time in seconds; larger values pair more pictures, with larger errors of a moving camera");
    v.texts("topics", topics,
            "topics of a ROS bag that are read, as in [/scan, /odom]; transforms and calibrations come with them; "
            "empty: by type, where there is one of a kind");
    v.text("robot_namespace", robot_namespace,
           "namespace of the robot that is read from a ROS bag of several robots, as in robot1 for /robot1/scan; "
           "empty: the bag is of one robot");
    v.text("robot_frame", robot_frame,
           "frame of the robot in a ROS bag, to which its sensors' transforms lead; empty: the child frame of the "
           "odometry, else base_footprint or base_link");
    v.flag("use_tf", use_tf,
           "use the transforms of a ROS bag to know where sensors stand; false: lasers stand as laser_x_m, laser_y_m "
           "and laser_yaw_rad say, cameras look ahead from the robot's origin");
    v.flag("follow", follow,
           "read a recording that mapweave_ros, or serve robot --stdin, still writes as it grows, until it is "
           "finished; false: as far as it goes now");
    v.choice(
        "point_clouds", point_clouds,
        {{"automatic", PointCloudUse::automatic}, {"scans", PointCloudUse::scans}, {"depth", PointCloudUse::depth}},
        "what point clouds of a ROS bag become: scans (planar scans), depth (depth pictures of a camera, of which "
        "they hold a point for each pixel) or automatic (depth where a topic .../depth*/points has a camera_info "
        "and no depth image beside it, else scans)");
    v.integer("cloud_ring", cloud_ring, -1, 65535,
              "number of the ring whose points become planar scans, in a ROS bag with point clouds of a lidar with "
              "rings; -1: the most level one");
    v.number("cloud_low_m", cloud_low_m, -100.0, 100.0,
             "height in metres above the sensor from which points become planar scans, in a ROS bag with point clouds "
             "without rings; larger values drop more low points");
    v.number("cloud_high_m", cloud_high_m, -100.0, 100.0,
             "height in metres above the sensor up to which points become planar scans, in a ROS bag with point clouds "
             "without rings; larger values keep more high points");
  }
};

// The format is known by the content first, then by the extension; gz is undone where it is found. Throws Error:
// kMissing, kBadInput for an empty file, kUnsupported (naming the formats that are read) for anything unknown.
std::unique_ptr<ObservationStream> open_log(const std::filesystem::path& path, const ReadOptions& options = {});

// Loads what an observation keeps in files beside the log (cameras, depth cameras). Throws Error kMissing, naming the
// file, or kCorrupt.
void load_pictures(const mrpt::obs::CObservation& observation);

// Whether MRPT has set the time, to one that a Stamp can hold.
bool has_stamp(mrpt::Clock::time_point time);
// MRPT counts in steps of 100 ns, so a stamp that came from elsewhere loses up to 50 ns on its way there.
Stamp to_stamp(mrpt::Clock::time_point time);  // contract: has_stamp(time)
mrpt::Clock::time_point to_mrpt_time(Stamp stamp);

}  // namespace mapweave::rawlog
