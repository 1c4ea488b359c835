// Places known again in RGB-D folders of the TUM layout (rgb, depth, associations.txt, groundtruth.txt, camera.yaml):
// each picture is looked for among all others of all folders but those of its last seconds, and the five most alike are
// judged as single keyframes. A judgement is right where it agrees with the true poses; a picture can be known again
// where an older one of its folder shares 40 % of the view.
//   place_recognition_benchmark [--every N] [--gap SECONDS] FOLDER...
#include <mapweave/matching/place_index.h>
#include <mapweave/matching/visual_judge.h>
#include <yaml-cpp/yaml.h>

#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <sstream>

using namespace mapweave;
using namespace mapweave::matching;

namespace {

constexpr double kGround_s = 0.03, kShared = 0.4, kRight_m = 0.25, kRight_rad = 0.15, kBelieved = 0.6,
                 kFarthest_m = 6.0;

struct Camera {
  Pinhole pinhole;
  std::vector<double> distortion;  // k1 k2 p1 p2 k3
  double units_per_metre;
  Eigen::Vector2d rectified(const Eigen::Vector2d& pixel) const {
    const Eigen::Vector3d seen = pinhole.ray(pixel);
    double x = seen.x(), y = seen.y();
    for (int i = 0; i < 10; ++i) {
      const double r2 = x * x + y * y, radial = 1.0 + r2 * (distortion[0] + r2 * (distortion[1] + r2 * distortion[4]));
      const double dx = 2.0 * distortion[2] * x * y + distortion[3] * (r2 + 2.0 * x * x);
      const double dy = distortion[2] * (r2 + 2.0 * y * y) + 2.0 * distortion[3] * x * y;
      x = (seen.x() - dx) / radial;
      y = (seen.y() - dy) / radial;
    }
    return pinhole.project({x, y, 1.0});
  }
};

struct Picture {
  std::size_t folder;
  double time;
  Pose3 world_from_camera;
  OrbFeatures features;
  DescribedPicture words;
  std::vector<std::int32_t> landmark_of_feature;
  std::vector<Eigen::Vector3d> surface;  // a coarse grid of depths, in the camera
  PlaceView place;
};

using Truth = std::map<double, Pose3>;
Truth read_truth(const std::filesystem::path& path) {
  Truth truth;
  std::ifstream file(path);
  for (std::string line; std::getline(file, line);) {
    std::istringstream numbers(line);
    double time, x, y, z, qx, qy, qz, qw;
    if (numbers >> time >> x >> y >> z >> qx >> qy >> qz >> qw)
      truth[time] = {{x, y, z}, Eigen::Quaterniond(qw, qx, qy, qz).normalized()};
  }
  return truth;
}

const Pose3* nearest(const Truth& truth, double time) {
  auto place = truth.lower_bound(time);
  if (place == truth.end() || (place != truth.begin() && time - std::prev(place)->first < place->first - time)) --place;
  return std::abs(place->first - time) < kGround_s ? &place->second : nullptr;
}

void add_folder(const std::filesystem::path& folder, std::size_t number, int every, std::vector<Picture>& pictures) {
  const YAML::Node yaml = YAML::LoadFile(folder / "camera.yaml");
  Camera camera{{yaml["width"].as<int>(), yaml["height"].as<int>(), yaml["fx"].as<double>(), yaml["fy"].as<double>(),
                 yaml["cx"].as<double>(), yaml["cy"].as<double>()},
                yaml["distortion"].as<std::vector<double>>(),
                yaml["depth_scale"].as<double>()};
  camera.distortion.resize(5, 0.0);
  const Truth truth = read_truth(folder / "groundtruth.txt");
  std::ifstream list(folder / "associations.txt");
  std::uint32_t index = 0;
  for (std::string line; std::getline(list, line);) {
    std::istringstream words(line);
    double time, depth_time;
    std::string grey_name, depth_name;
    if (!(words >> time >> grey_name >> depth_time >> depth_name) || index++ % static_cast<std::uint32_t>(every) != 0)
      continue;
    const Pose3* pose = nearest(truth, time);
    if (pose == nullptr) continue;
    const cv::Mat grey = cv::imread(folder / grey_name, cv::IMREAD_GRAYSCALE),
                  depth = cv::imread(folder / depth_name, cv::IMREAD_UNCHANGED);
    const auto depth_m = [&](double u, double v) {
      return depth.at<std::uint16_t>(static_cast<int>(std::lround(v)), static_cast<int>(std::lround(u))) /
             camera.units_per_metre;
    };
    Picture picture{number, time, *pose, orb_features({grey.data, grey.cols, grey.rows, grey.step}), {}, {}, {}, {}};
    for (std::size_t i = 0; i < picture.features.points.size(); ++i) {
      FeaturePoint& point = picture.features.points[i];
      const double z = depth_m(point.u_px, point.v_px);
      const Eigen::Vector2d pixel = camera.rectified({point.u_px, point.v_px});
      point.u_px = static_cast<float>(pixel.x());
      point.v_px = static_cast<float>(pixel.y());
      const bool known = z > 0.0 && z < kFarthest_m;
      picture.landmark_of_feature.push_back(known ? static_cast<std::int32_t>(picture.place.landmarks.size()) : -1);
      if (known) picture.place.landmarks.push_back({z * camera.pinhole.ray(pixel), picture.features.descriptors[i]});
    }
    for (int v = 20; v < depth.rows; v += 40)
      for (int u = 20; u < depth.cols; u += 40)
        if (const double z = depth_m(u, v); z > 0.0 && z < kFarthest_m)
          picture.surface.push_back(z * camera.pinhole.ray(camera.rectified({1.0 * u, 1.0 * v})));
    picture.words = shipped_vocabulary().describe_picture(picture.features.descriptors);
    picture.place.id = {{{RobotId("robot" + std::to_string(number)), SensorId("camera")}, 1}, index};
    picture.place.content = hash_of_bytes(to_string(picture.place.id));
    picture.place.keyframes.resize(1);
    picture.place.keyframes[0].camera = camera.pinhole;
    pictures.push_back(std::move(picture));
  }
}

double seen_by(const Picture& other, const Picture& one) {
  const Pose3 other_from_one = between(other.world_from_camera, one.world_from_camera);
  const Pinhole& camera = other.place.keyframes[0].camera;
  double seen = 0.0;
  for (const Eigen::Vector3d& point : one.surface) {
    const Eigen::Vector3d there = transformed(point, other_from_one);
    seen += there.z() > 0.1 && camera.shows(camera.project(there));
  }
  return one.surface.empty() ? 0.0 : seen / static_cast<double>(one.surface.size());
}

bool is_right(const Picture& a, const Picture& b, const VisualJudgement& result) {
  const Pose3 error =
      between(result.judgement.hypotheses.front().a_from_b.pose, between(a.world_from_camera, b.world_from_camera));
  return a.folder == b.folder && error.t.norm() < kRight_m && 2.0 * error.q.vec().norm() < kRight_rad;
}

}  // namespace

int main(int argc, char** argv) {
  int every = 3;
  double gap_s = 1.0;
  std::vector<std::string> folders;
  for (int i = 1; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--every" && i + 1 < argc)
      every = std::max(1, std::atoi(argv[++i]));
    else if (word == "--gap" && i + 1 < argc)
      gap_s = std::atof(argv[++i]);
    else
      folders.push_back(word);
  }
  std::vector<Picture> pictures;
  for (std::size_t i = 0; i < folders.size(); ++i) add_folder(folders[i], i, every, pictures);
  PlaceIndex index(shipped_vocabulary().words());
  std::map<NodeId, const Picture*> by_id;
  for (Picture& picture : pictures) {
    KeyframeView& keyframe = picture.place.keyframes[0];
    keyframe.id = {picture.place.id.session, picture.place.id.index};
    keyframe.features = view_of(picture.features);
    keyframe.features.nodes = picture.words.node_of_feature.data();
    keyframe.landmark_of_feature = picture.landmark_of_feature.data();
    index.add(keyframe.id, picture.words.bag);
    by_id[keyframe.id] = &picture;
  }
  struct Count {
    int pictures = 0, could = 0, known = 0, right = 0, wrong = 0, judged = 0;
    std::clock_t judging = 0;
  };
  std::vector<Count> counts(folders.size());
  for (const Picture& picture : pictures) {
    Count& count = counts[picture.folder];
    const auto is_older = [&](const Picture& other) {
      return other.folder == picture.folder && picture.time - other.time > gap_s;
    };
    double shared = 0.0;
    for (const Picture& other : pictures)
      if (is_older(other)) shared = std::max(shared, std::min(seen_by(other, picture), seen_by(picture, other)));
    bool known = false;
    const auto is_out = [&](const NodeId& id) {
      return by_id.at(id)->folder == picture.folder && !is_older(*by_id.at(id));
    };
    for (const SimilarPlace& similar : index.query(picture.words.bag, 5, is_out)) {
      const Picture* a = &picture;
      const Picture* b = by_id.at(similar.id);
      if (b->place.id < a->place.id) std::swap(a, b);
      const std::clock_t start = std::clock();
      const VisualJudgement result = judge_places(a->place, b->place);
      count.judging += std::clock() - start;
      ++count.judged;
      if (result.judgement.doubt != Reason::none || result.judgement.probability < kBelieved) continue;
      const bool right = is_right(*a, *b, result);
      (right ? count.right : count.wrong) += 1;
      known = known || right;
    }
    ++count.pictures;
    count.could += shared > kShared;
    count.known += shared > kShared && known;
  }
  for (std::size_t i = 0; i < folders.size(); ++i) {
    const Count& c = counts[i];
    std::printf(
        "%s: %d pictures; %d judgements believed, precision %.4f; %d could be known again, recall %.3f; %.1f ms a "
        "judgement\n",
        folders[i].c_str(), c.pictures, c.right + c.wrong, 1.0 * c.right / std::max(1, c.right + c.wrong), c.could,
        1.0 * c.known / std::max(1, c.could),
        1e3 * static_cast<double>(c.judging) / CLOCKS_PER_SEC / std::max(1, c.judged));
  }
}
