#include "camera_folder.h"

namespace mapweave::rawlog {

const std::vector<FolderLayout>& folder_layouts() {
  static const std::vector<FolderLayout> all = {
      {"TUM RGB-D folder", is_tum_folder, read_tum_folder, write_tum_part},
      {"EuRoC folder", is_euroc_folder, read_euroc_folder, write_euroc_part},
      {"KITTI odometry folder", is_kitti_folder, read_kitti_folder, write_kitti_part},
  };
  return all;
}

const FolderLayout& recognise_folder(const std::filesystem::path& folder) {
  for (const FolderLayout& layout : folder_layouts())
    if (layout.recognises(folder)) return layout;
  throw Error(ErrorCode::kUnsupported,
              "is a folder of no layout that is read: TUM RGB-D (rgb.txt and depth.txt, or associations.txt), KITTI "
              "odometry (image_0, "
              "calib.txt, times.txt), EuRoC (mav0/cam0/data.csv, or stereo.txt with cam0_sensor.yaml)",
              folder.string(), "name a log file, or a folder that holds these files");
}

}  // namespace mapweave::rawlog
