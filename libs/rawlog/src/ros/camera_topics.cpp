#include "camera_topics.h"

#include <algorithm>
#include <map>
#include <utility>

namespace mapweave::rawlog::ros {
namespace {

struct PictureTopic {
  const CameraTopic* topic;
  std::string folder, name;  // "camera/rgb", "image_raw"
  bool is_depth = false;
};

// A folder of topics with the picture that is used.
struct OneCamera {
  PictureTopic picture;
  std::string label;
  const CameraTopic* calibration = nullptr;
  bool is_paired = false;
};

std::string folder_of(const std::string& path) {
  const std::size_t slash = path.rfind('/');
  return slash == std::string::npos ? std::string() : path.substr(0, slash);
}

std::string last_part(const std::string& path) { return path.substr(path.rfind('/') + 1); }

std::string driver_of(const std::string& folder) { return folder.substr(0, folder.find('/')); }

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

PictureTopic picture_of(const CameraTopic& topic) {
  std::string path = topic.relative;
  if (topic.form == PictureForm::compressed) path = folder_of(path);  // the transport
  PictureTopic picture{&topic, folder_of(path), last_part(path), false};
  picture.is_depth = topic.form == PictureForm::cloud || contains(topic.relative, "depth");
  return picture;
}

// Clouds are made of rectified depth.
bool is_rectified(const PictureTopic& picture) {
  return picture.topic->form == PictureForm::cloud || contains(picture.name, "rect");
}

// Smaller is better.
int rank(const PictureTopic& picture) {
  static const std::vector<std::string> names = {"image_raw",  "image_color",      "image",
                                                 "image_mono", "image_rect_color", "image_rect"};
  const auto known = std::find(names.begin(), names.end(), picture.name);
  return 3 * static_cast<int>(known - names.begin()) + static_cast<int>(picture.topic->form);
}

// In the picture's folder. Clouds have none of their own: it may be in a folder around theirs, or be the only one of
// their driver.
const CameraTopic* calibration_of(const PictureTopic& picture, const std::vector<CameraTopic>& topics) {
  std::vector<const CameraTopic*> of_driver;
  std::map<std::string, const CameraTopic*> by_folder;
  for (const CameraTopic& topic : topics) {
    if (!topic.is_calibration) continue;
    const std::string folder = folder_of(topic.relative);
    by_folder[folder] = &topic;
    if (driver_of(folder) == driver_of(picture.folder)) of_driver.push_back(&topic);
  }
  for (std::string folder = picture.folder;; folder = folder_of(folder)) {
    if (const auto found = by_folder.find(folder); found != by_folder.end()) return found->second;
    if (picture.topic->form != PictureForm::cloud || folder.empty()) break;
  }
  return picture.topic->form == PictureForm::cloud && of_driver.size() == 1 ? of_driver.front() : nullptr;
}

std::vector<OneCamera> cameras_of(const std::vector<CameraTopic>& topics, bool are_named) {
  std::map<std::string, std::vector<PictureTopic>> folders;
  for (const CameraTopic& topic : topics) {
    if (topic.is_calibration) continue;
    PictureTopic picture = picture_of(topic);
    // JPEG of depth is of no use; "compressedDepth" is PNG.
    const bool is_of_depth = last_part(topic.relative) == "compressedDepth";
    if (topic.form == PictureForm::compressed && is_of_depth != picture.is_depth) continue;
    folders[picture.folder].push_back(std::move(picture));
  }
  std::vector<OneCamera> cameras;
  for (auto& [folder, pictures] : folders) {
    std::stable_sort(pictures.begin(), pictures.end(), [](const auto& a, const auto& b) { return rank(a) < rank(b); });
    if (!are_named) pictures.resize(1, pictures.front());
    for (const PictureTopic& picture : pictures) {
      const std::string label = pictures.size() > 1 || folder.empty() ? picture.topic->relative : folder;
      cameras.push_back({picture, label, calibration_of(picture, topics), false});
    }
  }
  return cameras;
}

std::size_t add_topic(const CameraTopic& topic, TopicRole role, const std::string& label, std::size_t camera,
                      ChosenTopics& chosen) {
  chosen.topics.push_back({topic.topic, role, label, topic.form, camera});
  return chosen.topics.size() - 1;
}

// A cloud's calibration may be that of its colour pictures.
bool is_chosen(const CameraTopic& topic, const ChosenTopics& chosen) {
  return std::any_of(chosen.topics.begin(), chosen.topics.end(),
                     [&](const ChosenTopic& known) { return known.topic == topic.topic; });
}

void add_camera(BagCameraKind kind, const std::string& label, OneCamera& first, OneCamera* second,
                ChosenTopics& chosen) {
  const std::size_t index = chosen.cameras.size();
  BagCamera camera;
  camera.kind = kind;
  camera.label = label;
  const auto add = [&](OneCamera& one, std::optional<std::size_t>& picture, std::optional<std::size_t>& calibration,
                       std::string& camera_info) {
    one.is_paired = true;
    camera_info = one.picture.folder + (one.picture.folder.empty() ? "" : "/") + "camera_info";
    picture = add_topic(*one.picture.topic, one.picture.is_depth ? TopicRole::depth_image : TopicRole::image, label,
                        index, chosen);
    if (one.calibration != nullptr && !is_chosen(*one.calibration, chosen))
      calibration = add_topic(*one.calibration, TopicRole::calibration, label, index, chosen);
  };
  const bool is_depth_alone = kind == BagCameraKind::depth && second == nullptr;
  if (is_depth_alone) {
    add(first, camera.second, camera.second_calibration, camera.second_camera_info);
    camera.second_is_rectified = is_rectified(first.picture);
  } else {
    add(first, camera.first, camera.first_calibration, camera.first_camera_info);
    camera.first_is_rectified = is_rectified(first.picture);
  }
  if (second != nullptr) {
    add(*second, camera.second, camera.second_calibration, camera.second_camera_info);
    camera.second_is_rectified = is_rectified(second->picture);
  }
  chosen.cameras.push_back(std::move(camera));
}

// What both folders begin with, or the first.
std::string common_label(const OneCamera& first, const OneCamera& second) {
  std::string parent = folder_of(first.label);
  while (!parent.empty() && second.label.rfind(parent + "/", 0) != 0) parent = folder_of(parent);
  return parent.empty() ? first.label : parent;
}

void pair_stereo(std::vector<OneCamera>& cameras, ChosenTopics& chosen) {
  for (const auto& [left_word, right_word] :
       {std::pair<std::string, std::string>("left", "right"), {"infra1", "infra2"}}) {
    for (OneCamera& left : cameras) {
      const std::size_t place = left.picture.folder.rfind(left_word);
      if (place == std::string::npos || left.is_paired || left.picture.is_depth) continue;
      std::string folder = left.picture.folder;
      folder.replace(place, left_word.size(), right_word);
      const auto right = std::find_if(cameras.begin(), cameras.end(), [&](const OneCamera& other) {
        return !other.is_paired && other.picture.folder == folder && other.picture.name == left.picture.name;
      });
      if (right != cameras.end()) add_camera(BagCameraKind::stereo, common_label(left, *right), left, &*right, chosen);
    }
  }
}

// Depth that is registered to a colour camera goes before depth of its own camera.
void pair_depth(std::vector<OneCamera>& cameras, ChosenTopics& chosen) {
  std::vector<OneCamera*> depths;
  for (OneCamera& camera : cameras)
    if (camera.picture.is_depth) depths.push_back(&camera);
  const auto is_registered = [](const OneCamera* camera) {
    return contains(camera->picture.folder, "registered") || contains(camera->picture.folder, "aligned");
  };
  std::stable_partition(depths.begin(), depths.end(), is_registered);
  const auto is_of_driver = [](const OneCamera& one, const OneCamera& other) {
    return driver_of(one.picture.folder) == driver_of(other.picture.folder);
  };
  for (OneCamera* depth : depths) {
    const auto colour = std::find_if(cameras.begin(), cameras.end(), [&](const OneCamera& other) {
      return !other.is_paired && !other.picture.is_depth && is_of_driver(other, *depth);
    });
    if (colour != cameras.end()) {
      add_camera(BagCameraKind::depth, common_label(*colour, *depth), *colour, depth, chosen);
      continue;
    }
    // The same depth once more, as its camera sees it.
    const bool is_known = std::any_of(depths.begin(), depths.end(), [&](const OneCamera* other) {
      return other != depth && other->is_paired && is_of_driver(*other, *depth);
    });
    if (!is_known) add_camera(BagCameraKind::depth, depth->label, *depth, nullptr, chosen);
  }
}

}  // namespace

bool is_depth_cloud(const std::string& relative, const std::vector<CameraTopic>& topics) {
  const std::string folder = folder_of(relative);
  if (last_part(relative) != "points" || !contains(last_part(folder), "depth")) return false;
  bool has_calibration = false, has_depth = false;
  for (const CameraTopic& topic : topics) {
    if (driver_of(folder_of(topic.relative)) != driver_of(folder)) continue;
    has_calibration = has_calibration || topic.is_calibration;
    has_depth = has_depth || (!topic.is_calibration && picture_of(topic).is_depth);
  }
  return has_calibration && !has_depth;
}

void add_camera_topics(const std::vector<CameraTopic>& topics, bool are_named, ChosenTopics& chosen) {
  std::vector<OneCamera> cameras = cameras_of(topics, are_named);
  pair_stereo(cameras, chosen);
  pair_depth(cameras, chosen);
  for (OneCamera& camera : cameras)
    if (!camera.is_paired && !camera.picture.is_depth)
      add_camera(BagCameraKind::mono, camera.label, camera, nullptr, chosen);
}

}  // namespace mapweave::rawlog::ros
