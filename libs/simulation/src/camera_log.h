#pragma once
// One camera's part of a robot's log: pictures, folders and the truth.

#include <mapweave/simulation/camera_recording.h>

#include <mrpt/obs/CObservation.h>

#include <filesystem>
#include <string>

namespace mapweave::simulation {

// A line of a trajectory in the form of the TUM RGB-D benchmark.
std::string tum_line(Stamp, const Pose3&);

class CameraLog {
 public:
  // Into an existing folder. Throws Error kBadInput for a camera that the layout cannot hold, kCannotWrite.
  CameraLog(const World& world, std::size_t robot, std::size_t camera, std::filesystem::path folder);
  const CameraRecording& recording() const { return recording_; }

  struct Entry {
    Stamp stamp, depth_stamp;
    Pose3 world_from_camera;
    mrpt::obs::CObservation::Ptr observation;  // null where the rawlog has no cameras
  };
  // Makes a frame and writes its pictures. May be called by many threads, each with its own workspace.
  Entry make(std::size_t frame, CameraRecording::Workspace&) const;
  void add(const Entry&);  // in order
  void close();            // writes what is left, once

 private:
  bool has_folder() const;
  bool has_rawlog() const;
  std::string picture_file(std::size_t frame, const char* side) const;

  LogOptions options_;
  CameraRecording recording_;
  std::filesystem::path folder_, own_folder_;  // of all logs; of this camera's pictures in the other layout
  std::string robot_;
  std::string truth_, colour_list_, depth_list_, pairs_, times_, poses_;
  std::optional<Pose3> first_from_world_;
  Stamp first_stamp_;
};

}  // namespace mapweave::simulation
