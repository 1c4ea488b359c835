#pragma once
// A folder of pictures and lists that some data set publishes, understood: one reader each for TUM RGB-D, KITTI
// odometry and EuRoC. What they find is streamed (folder_source.cpp) and cut (folder_split.cpp) in the same way.

#include "record_source.h"

#include <mapweave/core/error.h>
#include <mrpt/img/TCamera.h>
#include <mrpt/poses/CPose3D.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace mapweave::rawlog {

// Pictures taken together; their files are relative to the folder.
struct FolderFrame {
  Stamp stamp, second_stamp;                  // as the folder has them, to the nanosecond
  std::string stamp_text, second_stamp_text;  // as it writes them
  std::filesystem::path first, second;        // colour or left; depth or right, empty where there is one camera
};

// Lines of a stamp and three accelerations, or three turn rates and three accelerations.
struct ImuFile {
  std::filesystem::path file;  // relative to the folder
  bool is_csv = false;         // of EuRoC: nanoseconds, turn rates, accelerations; else TUM's: seconds, accelerations
  mrpt::poses::CPose3D robot_from_imu;
};

enum class FolderKind { kMono, kStereo, kDepth };

struct CameraFolder {
  std::filesystem::path folder,
      calibration;  // `calibration`: the file that holds the size of the pictures, for messages
  FolderKind kind = FolderKind::kMono;
  std::vector<FolderFrame> frames;  // stamps rise
  mrpt::img::TCamera first, second;
  mrpt::poses::CPose3D robot_from_first, first_from_second;  // optical axes: x right, y down, z ahead
  double depth_scale = 0.0;                                  // steps of a depth picture to the metre
  std::optional<ImuFile> imu;
  std::optional<Error> trouble;  // ends the recording after its frames
};

// Frames begin .. end - 1 of a folder, and measurements of stamps in [from, to).
struct FolderPart {
  std::size_t begin = 0, end = 0;
  Stamp from, to;
};

struct FolderLayout {
  const char* name;         // "TUM RGB-D folder"
  bool truth_is_of_camera;  // the data set's ground truth follows the (left) camera's optical frame, else the body
  bool (*recognises)(const std::filesystem::path& folder);
  // Throws Error for what leaves nothing to read: a calibration or list that is missing or empty, pictures that never
  // pair.
  CameraFolder (*read)(const std::filesystem::path& folder, const ReadOptions& options);
  // Makes the same layout of a part: pictures, lists, calibrations, truth. Inertial measurements are cut for all
  // layouts alike.
  void (*write_part)(const CameraFolder& whole, const FolderPart& part, const std::filesystem::path& out);
};

const std::vector<FolderLayout>& folder_layouts();
// Throws Error kUnsupported, naming the layouts and what makes them.
const FolderLayout& recognise_folder(const std::filesystem::path& folder);
std::unique_ptr<RecordSource> open_folder(CameraFolder folder);

bool is_tum_folder(const std::filesystem::path& folder);
CameraFolder read_tum_folder(const std::filesystem::path& folder, const ReadOptions& options);
void write_tum_part(const CameraFolder& whole, const FolderPart& part, const std::filesystem::path& out);
bool is_kitti_folder(const std::filesystem::path& folder);
CameraFolder read_kitti_folder(const std::filesystem::path& folder, const ReadOptions& options);
void write_kitti_part(const CameraFolder& whole, const FolderPart& part, const std::filesystem::path& out);
bool is_euroc_folder(const std::filesystem::path& folder);
CameraFolder read_euroc_folder(const std::filesystem::path& folder, const ReadOptions& options);
void write_euroc_part(const CameraFolder& whole, const FolderPart& part, const std::filesystem::path& out);

// How a camera that looks along the robot's x axis stands on it, in optical axes: where a folder does not say better.
mrpt::poses::CPose3D looking_ahead();

}  // namespace mapweave::rawlog
