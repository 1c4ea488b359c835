#pragma once
// Which topics of pictures and calibrations belong to one camera, by the names that drivers give them.

#include "topic_choice.h"

#include <string>
#include <vector>

namespace mapweave::rawlog::ros {

struct CameraTopic {
  std::size_t topic = 0;  // index into BagReader::topics()
  std::string relative;   // "camera/rgb/image_raw/compressed"
  bool is_calibration = false, is_compressed = false;
};

// Adds cameras and their topics to what is chosen. Of the pictures in one folder of topics one is taken (raw before
// rectified, sent whole before compressed), or where they were named by the user, each. Folders "left" and "right"
// become a stereo pair, "depth" with a colour camera beside it a depth camera.
void add_camera_topics(const std::vector<CameraTopic>& topics, bool are_named, ChosenTopics& chosen);

}  // namespace mapweave::rawlog::ros
