#include "topic_choice.h"

#include "camera_topics.h"

#include <mapweave/core/error.h>
#include <mapweave/core/log.h>
#include <mapweave/core/nearest_name.h>

#include <algorithm>
#include <map>
#include <set>

namespace mapweave::rawlog::ros {
namespace {

// A topic that may be read, and what it would be.
struct Candidate {
  std::size_t topic;
  TopicRole role;
  std::string relative;  // its name without namespace and first slash
};

std::string without_slash(const std::string& name) {
  return !name.empty() && name.front() == '/' ? name.substr(1) : name;
}

std::string first_part(const std::string& name) {
  const std::string bare = without_slash(name);
  const std::size_t slash = bare.find('/');
  return slash == std::string::npos ? std::string() : bare.substr(0, slash);
}

std::string last_part(const std::string& name) { return name.substr(name.rfind('/') + 1); }

std::optional<TopicRole> role_of(const BagTopic& topic) {
  static const std::map<std::string, TopicRole> roles = {{"sensor_msgs/LaserScan", TopicRole::scan},
                                                         {"sensor_msgs/MultiEchoLaserScan", TopicRole::multi_echo_scan},
                                                         {"sensor_msgs/PointCloud2", TopicRole::cloud},
                                                         {"nav_msgs/Odometry", TopicRole::odometry},
                                                         {"sensor_msgs/Imu", TopicRole::imu},
                                                         {"sensor_msgs/NavSatFix", TopicRole::position},
                                                         {"sensor_msgs/Image", TopicRole::image},
                                                         {"sensor_msgs/CompressedImage", TopicRole::image},
                                                         {"sensor_msgs/CameraInfo", TopicRole::calibration}};
  if (topic.type == "tf2_msgs/TFMessage" || topic.type == "tf/tfMessage")
    return last_part(topic.name) == "tf_static" ? TopicRole::static_transforms : TopicRole::transforms;
  const auto found = roles.find(topic.type);
  return found == roles.end() ? std::nullopt : std::optional(found->second);
}

bool is_transforms(TopicRole role) { return role == TopicRole::transforms || role == TopicRole::static_transforms; }
bool is_picture(TopicRole role) { return role == TopicRole::image || role == TopicRole::depth_image; }
bool is_scan(TopicRole role) { return role == TopicRole::scan || role == TopicRole::multi_echo_scan; }

// Namespaces that hold odometry under one name: two robots have theirs, two lasers of one robot have not.
std::vector<std::string> robots_by_odometry(const std::vector<BagTopic>& topics) {
  std::map<std::string, std::set<std::string>> by_relative;
  for (const BagTopic& topic : topics) {
    const std::string first = first_part(topic.name);
    if (role_of(topic) == TopicRole::odometry && !first.empty())
      by_relative[without_slash(topic.name).substr(first.size() + 1)].insert(first);
  }
  std::set<std::string> robots;
  for (const auto& [relative, namespaces] : by_relative)
    if (namespaces.size() > 1) robots.insert(namespaces.begin(), namespaces.end());
  return {robots.begin(), robots.end()};
}

std::string quoted_list(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

// What is in the bag, by type.
std::string contents(const std::vector<BagTopic>& topics) {
  constexpr std::size_t kMostShown = 40;
  std::string text;
  for (std::size_t i = 0; i < topics.size() && i < kMostShown; ++i)
    text += (text.empty() ? "" : ", ") + topics[i].name + " (" + topics[i].type + ")";
  if (topics.size() > kMostShown) text += " and " + std::to_string(topics.size() - kMostShown) + " more";
  return text.empty() ? "no topics" : text;
}

class Choice {
 public:
  Choice(const std::vector<BagTopic>& topics, const ReadOptions& options, const std::string& bag)
      : topics_(topics),
        options_(options),
        bag_(bag),
        has_counts_(
            std::any_of(topics.begin(), topics.end(), [](const BagTopic& topic) { return topic.messages > 0; })) {}

  ChosenTopics choose() {
    expect_one_robot();
    find_candidates();
    find_depth_clouds();
    if (options_.topics.empty())
      choose_by_type();
    else
      choose_by_name();
    add_transforms();
    add_cameras();
    if (std::all_of(chosen_.topics.begin(), chosen_.topics.end(), [](const ChosenTopic& topic) {
          return is_transforms(topic.role) || topic.role == TopicRole::position;
        }))
      refuse("holds no topic of a laser, a camera, an inertial unit or odometry; it has " + contents(topics_),
             "check that this is the right bag");
    return chosen_;
  }

 private:
  [[noreturn]] void refuse(const std::string& what, const std::string& remedy) const {
    throw Error(ErrorCode::kBadInput, what, bag_, remedy);
  }

  void expect_one_robot() const {
    const auto robots = robots_by_odometry(topics_);
    if (options_.robot_namespace.empty()) {
      if (robots.size() > 1 && options_.topics.empty())
        refuse("holds " + std::to_string(robots.size()) +
                   " robots, by the namespaces of their odometry: " + quoted_list(robots),
               "choose one with reading.robot_namespace=" + robots.front() +
                   ", or make a log of each with: mapweave split BAG --by-namespace --out DIR");
      return;
    }
    const std::string prefix = without_slash(options_.robot_namespace) + "/";
    if (std::any_of(topics_.begin(), topics_.end(),
                    [&](const BagTopic& topic) { return without_slash(topic.name).rfind(prefix, 0) == 0; }))
      return;
    std::set<std::string> there;
    for (const BagTopic& topic : topics_) there.insert(first_part(topic.name));
    there.erase("");
    const std::vector<std::string> names(there.begin(), there.end());
    const auto nearest = nearest_name(options_.robot_namespace, names);
    refuse(
        "has no namespace '" + options_.robot_namespace + "'; it has " + (names.empty() ? "none" : quoted_list(names)),
        nearest ? "did you mean '" + *nearest + "'?" : "correct reading.robot_namespace");
  }

  void find_candidates() {
    const std::string prefix = options_.robot_namespace.empty() ? "" : without_slash(options_.robot_namespace) + "/";
    for (std::size_t i = 0; i < topics_.size(); ++i) {
      const auto role = role_of(topics_[i]);
      if (!role || (has_counts_ && topics_[i].messages == 0)) continue;
      const std::string bare = without_slash(topics_[i].name);
      const bool is_within = bare.rfind(prefix, 0) == 0;
      // Transforms of all robots may be in one topic; frames have the names of their robots then.
      if (is_within || (is_transforms(*role) && (bare == "tf" || bare == "tf_static")))
        candidates_.push_back({i, *role, is_within ? bare.substr(prefix.size()) : bare});
    }
  }

  // Candidates that are pictures or calibrations of cameras.
  template <class IsWanted>
  std::vector<CameraTopic> camera_topics(const IsWanted& is_wanted) const {
    std::vector<CameraTopic> topics;
    for (const Candidate& candidate : candidates_) {
      const bool is_calibration = candidate.role == TopicRole::calibration;
      if (!is_calibration && (!is_picture(candidate.role) || !is_wanted(candidate))) continue;
      const std::string& type = topics_[candidate.topic].type;
      topics.push_back({candidate.topic, candidate.relative, is_calibration,
                        type == "sensor_msgs/CompressedImage" ? PictureForm::compressed
                        : type == "sensor_msgs/PointCloud2"   ? PictureForm::cloud
                                                              : PictureForm::raw});
    }
    return topics;
  }

  // Clouds that are read as pictures of a depth camera.
  void find_depth_clouds() {
    if (options_.point_clouds == PointCloudUse::scans) return;
    const std::vector<CameraTopic> cameras = camera_topics([](const Candidate&) { return true; });
    for (Candidate& candidate : candidates_)
      if (candidate.role == TopicRole::cloud &&
          (options_.point_clouds == PointCloudUse::depth || is_depth_cloud(candidate.relative, cameras)))
        candidate.role = TopicRole::depth_image;
  }

  void choose_by_type() {
    take_one([](TopicRole role) { return is_scan(role); }, "a laser");
    const bool has_scan = !chosen_.topics.empty();
    if (!has_scan) take_one([](TopicRole role) { return role == TopicRole::cloud; }, "a lidar with point clouds");
    take_one([](TopicRole role) { return role == TopicRole::odometry; }, "odometry");
    take_one([](TopicRole role) { return role == TopicRole::imu; }, "an inertial unit");
    for (const Candidate& candidate : candidates_) {
      if (is_picture(candidate.role)) images_.push_back(candidate.topic);
      if (candidate.role == TopicRole::position) take(candidate);
    }
  }

  template <class IsWanted>
  void take_one(const IsWanted& is_wanted, const std::string& what) {
    std::vector<const Candidate*> found;
    for (const Candidate& candidate : candidates_) {
      // Simulators and motion capture publish the truth as odometry: it is read where it is named.
      const bool is_truth = candidate.relative.find("ground_truth") != std::string::npos ||
                            candidate.relative.find("groundtruth") != std::string::npos;
      if (is_wanted(candidate.role) && !is_truth) found.push_back(&candidate);
    }
    if (found.empty()) return;
    if (found.size() == 1) return take(*found.front());
    std::vector<std::string> names;
    for (const Candidate* one : found) names.push_back(topics_[one->topic].name);
    refuse("holds " + std::to_string(found.size()) + " topics of " + what + " (" + topics_[found.front()->topic].type +
               "): " + quoted_list(names),
           "name all that are to be read, as in --set reading.topics=[" + suggestion(*found.front()) +
               "]; of several robots choose one with reading.robot_namespace");
  }

  // `preferred`, and the first topic of each other kind.
  std::string suggestion(const Candidate& preferred) const {
    std::vector<std::string> names;
    std::set<TopicRole> taken;
    for (const Candidate& candidate : candidates_) {
      if (is_transforms(candidate.role) || candidate.role == TopicRole::calibration ||
          (candidate.role == TopicRole::cloud && preferred.role != TopicRole::cloud))
        continue;
      const bool is_kind = candidate.role == preferred.role || (is_scan(candidate.role) && is_scan(preferred.role));
      if (is_kind ? candidate.topic == preferred.topic : taken.insert(candidate.role).second)
        names.push_back(topics_[candidate.topic].name);
    }
    return quoted_list(names);
  }

  void choose_by_name() {
    for (const std::string& name : options_.topics) {
      const std::string bare = without_slash(name);
      bool is_found = false;
      for (const Candidate& candidate : candidates_) {
        if (without_slash(topics_[candidate.topic].name) != bare && candidate.relative != bare) continue;
        is_found = true;
        if (is_picture(candidate.role))
          images_.push_back(candidate.topic);
        else if (!is_transforms(candidate.role) && candidate.role != TopicRole::calibration)
          take(candidate);
      }
      if (!is_found) refuse_name(name);
    }
  }

  [[noreturn]] void refuse_name(const std::string& name) const {
    std::vector<std::string> names;
    for (const BagTopic& topic : topics_) names.push_back(topic.name);
    for (const BagTopic& topic : topics_)
      if (without_slash(topic.name) == without_slash(name))
        refuse("the topic " + name + " is of type " + topic.type +
                   (has_counts_ && topic.messages == 0 ? " and has no messages" : ", which is not read"),
               "correct reading.topics");
    const auto nearest = nearest_name(name, names);
    refuse("has no topic '" + name + "'; it has " + contents(topics_),
           nearest ? "did you mean '" + *nearest + "'?" : "correct reading.topics");
  }

  void take(const Candidate& candidate) {
    for (const ChosenTopic& known : chosen_.topics)
      if (known.topic == candidate.topic) return;
    ChosenTopic& topic = chosen_.topics.emplace_back();
    topic.topic = candidate.topic;
    topic.role = candidate.role;
    topic.label = candidate.relative;
    chosen_.has_odometry = chosen_.has_odometry || candidate.role == TopicRole::odometry;
  }

  void add_transforms() {
    if (!options_.use_tf && chosen_.has_odometry) return;
    for (const Candidate& candidate : candidates_) {
      if (!is_transforms(candidate.role)) continue;
      take(candidate);
      chosen_.has_transforms = true;
    }
  }

  void add_cameras() {
    const auto all = camera_topics([&](const Candidate& candidate) {
      return std::find(images_.begin(), images_.end(), candidate.topic) != images_.end();
    });
    add_camera_topics(all, !options_.topics.empty(), chosen_);
  }

  const std::vector<BagTopic>& topics_;
  const ReadOptions& options_;
  const std::string& bag_;
  bool has_counts_;
  std::vector<Candidate> candidates_;
  std::vector<std::size_t> images_;
  ChosenTopics chosen_;
};

}  // namespace

ChosenTopics choose_topics(const std::vector<BagTopic>& topics, const ReadOptions& options, const std::string& bag) {
  return Choice(topics, options, bag).choose();
}

std::vector<std::string> robot_namespaces(const std::vector<BagTopic>& topics) {
  auto robots = robots_by_odometry(topics);
  if (robots.size() > 1) return robots;
  for (const auto is_wanted : {+[](TopicRole role) { return is_scan(role) || role == TopicRole::cloud; },
                               +[](TopicRole role) { return role == TopicRole::image; }}) {
    std::set<std::string> found;
    for (const BagTopic& topic : topics) {
      const auto role = role_of(topic);
      if (role && is_wanted(*role) && !first_part(topic.name).empty()) found.insert(first_part(topic.name));
    }
    if (!found.empty()) return {found.begin(), found.end()};
  }
  return robots;
}

}  // namespace mapweave::rawlog::ros
