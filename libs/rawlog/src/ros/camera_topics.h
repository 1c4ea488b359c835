#pragma once
// Which topics of pictures and calibrations belong to one camera, by the names that drivers give them.

#include "topic_choice.h"

#include <string>
#include <vector>

namespace mapweave::rawlog::ros {

struct CameraTopic {
  std::size_t topic = 0;  // index into BagReader::topics()
  std::string relative;   // "camera/rgb/image_raw/compressed"
  bool is_calibration = false;
  PictureForm form = PictureForm::raw;  // of pictures; a cloud is one of depth
};

// Whether a PointCloud2 of this name is taken for a depth camera's, among the images, compressed images and
// calibrations of its robot: DRIVER/.../depth*/points, with a calibration and without a depth image of the same driver.
bool is_depth_cloud(const std::string& relative, const std::vector<CameraTopic>& topics);

// Adds cameras and their topics to what is chosen. Of the pictures in one folder of topics one is taken (raw before
// rectified, sent whole before compressed, clouds last), or where they were named by the user, each. Folders "left" and
// "right" become a stereo pair, "depth" with a colour camera beside it a depth camera.
void add_camera_topics(const std::vector<CameraTopic>& topics, bool are_named, ChosenTopics& chosen);

}  // namespace mapweave::rawlog::ros
