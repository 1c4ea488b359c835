#include "landmark_finder.h"

#include "pictures/feature_grid.h"

#include <algorithm>

namespace mapweave::visual {
namespace {

constexpr int kTriesPerCell = 4;  // of the best landmarks of a cell: bounds time
constexpr double kBorder = 8.0;   // pixels
// Cosine and distance between views that show the same.
constexpr double kSameDirection = 0.8, kSamePlace_m = 1.0;

// The appearance from the view most like this one: nullptr where none is.
const Appearance* best_appearance(const LandmarkMap& map, const ClientLandmark& landmark,
                                  const Eigen::Vector3d& centre) {
  const Appearance* best = nullptr;
  double best_merit = 0.5;
  const Eigen::Vector3d ray = landmark.point - centre;
  const double range = ray.norm();
  for (const Appearance& appearance : landmark.appearances) {
    const Eigen::Vector3d other = landmark.point - map.view_of(appearance).centre();
    const double merit = ray.dot(other) / (range * other.norm()) - 0.2 * std::abs(std::log(other.norm() / range));
    if (merit > best_merit) {
      best_merit = merit;
      best = &appearance;
    }
  }
  return best;
}

std::optional<WarpedPatch> expected_look(const LandmarkMap& map, const ClientLandmark& landmark, const View& view) {
  const Appearance* appearance = best_appearance(map, landmark, view.centre());
  if (appearance == nullptr) return std::nullopt;
  const View old = map.view_of(*appearance);
  return warp_patch(appearance->patch, warp_to(map.camera, appearance->pixel, appearance->patch.level,
                                               view * old.inverse(), (old * landmark.point).z()));
}

}  // namespace

Eigen::Matrix2d warp_to(const Pinhole& camera, const Eigen::Vector2d& pixel, int level, const View& new_from_old,
                        double old_depth) {
  const double step = 4.0 * (1 << level);
  const auto carried = [&](double u, double v) {
    return camera.project(new_from_old * (camera.ray(pixel + Eigen::Vector2d(u, v)) * old_depth));
  };
  const Eigen::Vector2d here = carried(0, 0);
  Eigen::Matrix2d warp;
  warp.col(0) = (carried(step, 0) - here) / step;
  warp.col(1) = (carried(0, step) - here) / step;
  return warp;
}

std::optional<FoundLandmark> find_landmark(const LandmarkMap& map, const ClientLandmark& landmark,
                                           const Pyramid& picture, const View& view, const Eigen::Vector2d& start) {
  if (picture.features) {
    constexpr double kNear_px = 4.0;  // from where the feature is expected
    const int feature = picture.features->find(
        landmark.descriptor, start, kNear_px, std::vector<char>(static_cast<std::size_t>(picture.features->size()), 0));
    if (feature < 0) return std::nullopt;
    return FoundLandmark{picture.features->pixel(feature), picture.features->level(feature), 1.0F};
  }
  const auto warped = expected_look(map, landmark, view);
  if (!warped) return std::nullopt;
  // Pixels that an alignment may move; correlation, as options.min_correlation.
  constexpr float kReach = 2.0F, kAlike = 0.85F;
  const auto match = align_patch(*warped, picture[warped->level], start, kReach);
  if (!match || match->correlation < kAlike) return std::nullopt;
  return FoundLandmark{match->pixel, warped->level, match->correlation};
}

std::vector<int> near_keyframes(const LandmarkMap& map, int session, const std::vector<Match>& matches,
                                const View& view, int most) {
  std::vector<int> shared(map.keyframes.size(), 0);
  for (const Match& match : matches)
    for (const Observation& o : map.landmark(match.landmark).seen) ++shared[static_cast<std::size_t>(o.keyframe)];
  constexpr int kShared = 8;              // landmarks by which a keyframe is covisible
  constexpr double kMeritOfPlace = 60.0;  // in shared landmarks
  std::vector<std::pair<double, int>> order;
  const Eigen::Vector3d centre = view.centre(), ahead = view.rotation.row(2);
  for (std::size_t k = 0; k < map.keyframes.size(); ++k) {
    if (map.keyframes[k].gone || map.keyframes[k].session != session) continue;
    const View& other = map.keyframes[k].view;
    const double cosine = ahead.dot(other.rotation.row(2)), distance = (centre - other.centre()).norm();
    const bool looks_there = cosine > kSameDirection && distance < kSamePlace_m;
    if (shared[k] < kShared && !looks_there) continue;
    const double likeness = (cosine - kSameDirection) / (1.0 - kSameDirection) * (1.0 - distance / kSamePlace_m);
    order.emplace_back(-shared[k] - (looks_there ? kMeritOfPlace * likeness : 0.0), static_cast<int>(k));
  }
  std::sort(order.begin(), order.end());
  std::vector<int> result;
  for (std::size_t i = 0; i < order.size() && static_cast<int>(i) < most; ++i) result.push_back(order[i].second);
  return result;
}

int cell_of_scene(std::size_t landmarks, const Pinhole& camera, const TrackingOptions& options) {
  constexpr double kFew = 0.15;  // of the cells
  const double cells = camera.width * camera.height / static_cast<double>(options.cell_px * options.cell_px);
  return static_cast<double>(landmarks) < kFew * cells ? std::max(8, options.cell_px / 2) : options.cell_px;
}

std::vector<Match> LandmarkFinder::find(LandmarkMap& map, const std::vector<int>& keyframes, const Pyramid& picture,
                                        const View& guess, const Motion& motion, const TrackingOptions& options) {
  struct Candidate {
    double merit;
    int landmark;
    Eigen::Vector2d pixel;
    double depth;
  };
  ++look_;
  looked_at_.resize(map.landmarks.size(), 0);
  const Pinhole& camera = map.camera;
  const int columns = (camera.width + options.cell_px - 1) / options.cell_px,
            rows = (camera.height + options.cell_px - 1) / options.cell_px;
  // Borrowed ones in cells of their own: they take nobody's place.
  std::vector<std::vector<Candidate>> cells(static_cast<std::size_t>(2 * columns * rows));
  for (int k : keyframes)
    for (int id : map.keyframe(k).landmarks) {
      int& looked = looked_at_[static_cast<std::size_t>(id)];
      const ClientLandmark& landmark = map.landmark(id);
      if (landmark.gone || looked == look_) continue;
      looked = look_;
      const Eigen::Vector3d p = guess * landmark.point;
      if (p.z() < kNearest_m) continue;
      const Eigen::Vector2d pixel = camera.project(p);
      if (!(pixel.x() >= kBorder && pixel.y() >= kBorder && pixel.x() < camera.width - kBorder &&
            pixel.y() < camera.height - kBorder))
        continue;
      const double merit = static_cast<double>(landmark.seen.size()) + 3.0 * landmark.found / (landmark.tried + 1.0);
      const int first = landmark.borrowed ? columns * rows : 0;
      const int cell = first + static_cast<int>(pixel.y()) / options.cell_px * columns +
                       static_cast<int>(pixel.x()) / options.cell_px;
      cells[static_cast<std::size_t>(cell)].push_back({merit, id, pixel, p.z()});
    }
  std::vector<Match> result;
  std::vector<char> taken_by_own(picture.features ? static_cast<std::size_t>(picture.features->size()) : 0, 0),
      taken_by_borrowed = taken_by_own;
  for (auto& cell : cells) {
    std::sort(cell.begin(), cell.end(), [](const Candidate& a, const Candidate& b) {
      return a.merit != b.merit ? a.merit > b.merit : a.landmark < b.landmark;
    });
    int tries = 0;
    for (const Candidate& candidate : cell) {
      if (++tries > kTriesPerCell) break;
      ClientLandmark& landmark = map.landmark(candidate.landmark);
      if (picture.features) {
        ++landmark.tried;
        std::vector<char>& taken = landmark.borrowed ? taken_by_borrowed : taken_by_own;
        const int feature = picture.features->find(landmark.descriptor, candidate.pixel, options.reach_px, taken);
        if (feature < 0) continue;
        taken[static_cast<std::size_t>(feature)] = 1;
        result.push_back({candidate.landmark, picture.features->pixel(feature), Eigen::Vector2d::Zero(),
                          picture.features->level(feature), feature});
        continue;
      }
      const auto warped = expected_look(map, landmark, guess);
      if (!warped) continue;
      ++landmark.tried;
      const Eigen::Vector2d start =
          candidate.pixel + map.calibration.readout_s * row_flow(camera, motion, candidate.pixel, candidate.depth);
      const auto match = align_patch(*warped, picture[warped->level], start, static_cast<float>(options.reach_px));
      if (!match || static_cast<double>(match->correlation) < options.min_correlation) continue;
      result.push_back(
          {candidate.landmark, match->pixel, row_flow(camera, motion, match->pixel, candidate.depth), warped->level});
      break;
    }
  }
  return result;
}

}  // namespace mapweave::visual
