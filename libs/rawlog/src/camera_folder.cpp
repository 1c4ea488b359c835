#include "camera_folder.h"

namespace mapweave::rawlog {

const std::vector<FolderLayout>& folder_layouts() {
  static const std::vector<FolderLayout> all = {
      {"TUM RGB-D folder", true, is_tum_folder, read_tum_folder, write_tum_part},
      {"EuRoC folder", false, is_euroc_folder, read_euroc_folder, write_euroc_part},
      {"KITTI odometry folder", true, is_kitti_folder, read_kitti_folder, write_kitti_part},
  };
  return all;
}

const FolderLayout& recognise_folder(const std::filesystem::path& folder) {
  for (const FolderLayout& layout : folder_layouts())
    if (layout.recognises(folder)) return layout;
  std::string within;  // as archives are unpacked: a folder in a folder
  std::error_code ignored;
  for (const auto& entry : std::filesystem::directory_iterator(folder, ignored))
    for (const FolderLayout& layout : folder_layouts())
      if (entry.is_directory(ignored) && layout.recognises(entry.path()) &&
          (within.empty() || entry.path().string() < within))
        within = entry.path().string();
  throw Error(ErrorCode::kUnsupported,
              "is a folder of no layout that is read: rosbag2 (metadata.yaml), parts of a ROS 1 bag (NAME_0.bag), TUM "
              "RGB-D (rgb.txt and depth.txt, or "
              "associations.txt), KITTI "
              "odometry (image_0, "
              "calib.txt, times.txt), EuRoC (mav0/cam0/data.csv, or stereo.txt with cam0_sensor.yaml)",
              folder.string(),
              within.empty() ? "name a log file, or a folder that holds these files" : "did you mean " + within + "?");
}

}  // namespace mapweave::rawlog
