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

bool contains(const std::string& text, const std::string& part) { return text.find(part) != std::string::npos; }

PictureTopic picture_of(const CameraTopic& topic) {
  std::string path = topic.relative;
  if (topic.is_compressed) path = folder_of(path);  // the transport
  PictureTopic picture{&topic, folder_of(path), path.substr(path.rfind('/') + 1), false};
  picture.is_depth = contains(topic.relative, "depth");
  return picture;
}

bool is_rectified(const PictureTopic& picture) { return contains(picture.name, "rect"); }

// Smaller is better.
int rank(const PictureTopic& picture) {
  static const std::vector<std::string> names = {"image_raw",  "image_color",      "image",
                                                 "image_mono", "image_rect_color", "image_rect"};
  const auto known = std::find(names.begin(), names.end(), picture.name);
  return 2 * static_cast<int>(known - names.begin()) + (picture.topic->is_compressed ? 1 : 0);
}

std::vector<OneCamera> cameras_of(const std::vector<CameraTopic>& topics, bool are_named) {
  std::map<std::string, std::vector<PictureTopic>> folders;
  for (const CameraTopic& topic : topics) {
    if (topic.is_calibration) continue;
    PictureTopic picture = picture_of(topic);
    // JPEG of depth is of no use; "compressedDepth" is PNG.
    const std::string transport = topic.relative.substr(topic.relative.rfind('/') + 1);
    if (topic.is_compressed && (transport == "compressedDepth") != picture.is_depth) continue;
    folders[picture.folder].push_back(std::move(picture));
  }
  std::vector<OneCamera> cameras;
  for (auto& [folder, pictures] : folders) {
    std::stable_sort(pictures.begin(), pictures.end(), [](const auto& a, const auto& b) { return rank(a) < rank(b); });
    if (!are_named) pictures.resize(1, pictures.front());
    const CameraTopic* calibration = nullptr;
    for (const CameraTopic& topic : topics)
      if (topic.is_calibration && folder_of(topic.relative) == folder) calibration = &topic;
    for (const PictureTopic& picture : pictures) {
      const std::string label = pictures.size() > 1 || folder.empty() ? picture.topic->relative : folder;
      cameras.push_back({picture, label, calibration, false});
    }
  }
  return cameras;
}

std::size_t add_topic(const CameraTopic& topic, TopicRole role, const std::string& label, std::size_t camera,
                      ChosenTopics& chosen) {
  chosen.topics.push_back({topic.topic, role, label, topic.is_compressed, camera});
  return chosen.topics.size() - 1;
}

void add_camera(BagCameraKind kind, const std::string& label, OneCamera& first, OneCamera* second,
                ChosenTopics& chosen) {
  const std::size_t index = chosen.cameras.size();
  BagCamera camera;
  camera.kind = kind;
  camera.label = label;
  const auto add = [&](OneCamera& one, std::optional<std::size_t>& picture, std::optional<std::size_t>& calibration) {
    one.is_paired = true;
    picture = add_topic(*one.picture.topic, one.picture.is_depth ? TopicRole::depth_image : TopicRole::image, label,
                        index, chosen);
    if (one.calibration != nullptr)
      calibration = add_topic(*one.calibration, TopicRole::calibration, label, index, chosen);
  };
  const bool is_depth_alone = kind == BagCameraKind::depth && second == nullptr;
  if (is_depth_alone) {
    add(first, camera.second, camera.second_calibration);
    camera.second_is_rectified = is_rectified(first.picture);
  } else {
    add(first, camera.first, camera.first_calibration);
    camera.first_is_rectified = is_rectified(first.picture);
  }
  if (second != nullptr) {
    add(*second, camera.second, camera.second_calibration);
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
  const auto driver_of = [](const OneCamera& camera) {
    return camera.picture.folder.substr(0, camera.picture.folder.find('/'));
  };
  for (OneCamera* depth : depths) {
    const auto colour = std::find_if(cameras.begin(), cameras.end(), [&](const OneCamera& other) {
      return !other.is_paired && !other.picture.is_depth && driver_of(other) == driver_of(*depth);
    });
    if (colour != cameras.end()) {
      add_camera(BagCameraKind::depth, common_label(*colour, *depth), *colour, depth, chosen);
      continue;
    }
    // The same depth once more, as its camera sees it.
    const bool is_known = std::any_of(depths.begin(), depths.end(), [&](const OneCamera* other) {
      return other != depth && other->is_paired && driver_of(*other) == driver_of(*depth);
    });
    if (!is_known) add_camera(BagCameraKind::depth, depth->label, *depth, nullptr, chosen);
  }
}

}  // namespace

void add_camera_topics(const std::vector<CameraTopic>& topics, bool are_named, ChosenTopics& chosen) {
  std::vector<OneCamera> cameras = cameras_of(topics, are_named);
  pair_stereo(cameras, chosen);
  pair_depth(cameras, chosen);
  for (OneCamera& camera : cameras)
    if (!camera.is_paired && !camera.picture.is_depth)
      add_camera(BagCameraKind::mono, camera.label, camera, nullptr, chosen);
}

}  // namespace mapweave::rawlog::ros
