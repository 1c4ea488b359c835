#include <mapweave/matching/landmark_description.h>

#include <algorithm>
#include <cmath>

namespace mapweave::matching {

namespace {

constexpr int kRow = 64;  // units of a point's place

std::size_t row_of(int v) { return static_cast<std::size_t>(v / kRow); }

}  // namespace

struct LandmarkDescriber::Look {
  OrbDescriptor descriptor{};
  Eigen::Vector3d feature_from_point = Eigen::Vector3d::Zero();
  bool has_feature = false;
};

LandmarkDescriber::LandmarkDescriber(const Map& map, const DescriptionOptions& options) : options_(options) {
  nodes_.reserve(map.nodes.size());
  for (const auto& [id, node] : map.nodes) {
    numbers_.add(id);
    Known& known = nodes_.emplace_back();
    known.node = &node;
    known.keyframe = keyframe_of(node);
    if (known.keyframe == nullptr) continue;
    known.map_from_camera = compose(node.map_from_node, known.keyframe->geometry->robot_from_camera);
    known.camera_from_map = inverse(known.map_from_camera);
    sort_by_row(known);
  }
}

void LandmarkDescriber::sort_by_row(Known& known) const {
  const auto& points = known.keyframe->points;
  std::size_t rows = 1;
  int level = 0;
  for (const KeyframePoint& point : points) {
    rows = std::max(rows, row_of(point.v) + 1);
    level = std::max<int>(level, point.level);
  }
  const double reach_px = options_.reach_px * std::pow(std::max(1.0, known.keyframe->geometry->level_scale), level);
  for (int l = 0; l <= level; ++l) known.per_px2.push_back(std::pow(known.keyframe->geometry->level_scale, -2.0 * l));
  known.far = static_cast<int>(std::min(std::ceil(reach_px / kPixelUnit_px), 65536.0));
  known.begin.assign(rows + 1, 0);
  for (const KeyframePoint& point : points) ++known.begin[row_of(point.v) + 1];
  for (std::size_t row = 1; row <= rows; ++row) known.begin[row] += known.begin[row - 1];
  std::vector<std::uint32_t> next(known.begin.begin(), known.begin.end() - 1);
  known.by_row.resize(points.size());
  for (std::uint32_t i = 0; i < points.size(); ++i) known.by_row[next[row_of(points[i].v)]++] = i;
}

// A feature beside the sighting, at the landmark's depth; of several the nearest in pixels of its level, then the
// first.
LandmarkDescriber::Look LandmarkDescriber::look(const Known& known, const LandmarkSighting& sighting,
                                                double depth_m) const {
  const auto& points = known.keyframe->points;
  const CameraGeometry& camera = *known.keyframe->geometry;
  const int u = sighting.u, v = sighting.v, far = known.far;
  const std::size_t rows = known.begin.size() - 1, first = std::min(rows, row_of(std::max(0, v - far))),
                    last = std::min(rows, row_of(v + far) + 1);
  Look look;
  double best = options_.reach_px * options_.reach_px;
  std::uint32_t feature = 0;
  for (std::uint32_t place = known.begin[first]; place < known.begin[last]; ++place) {
    const std::uint32_t i = known.by_row[place];
    const KeyframePoint& point = points[i];
    if (std::abs(point.u - u) > far || std::abs(point.v - v) > far) continue;
    const double du = kPixelUnit_px * (point.u - u), dv = kPixelUnit_px * (point.v - v);
    const double apart = (du * du + dv * dv) * known.per_px2[point.level];
    if (!(apart < best || (look.has_feature && apart <= best && i < feature))) continue;
    best = apart;
    feature = i;
    look.has_feature = true;
    look.descriptor = known.keyframe->descriptors[i];
    look.feature_from_point =
        known.map_from_camera.q * (depth_m * Eigen::Vector3d(du / camera.fx, dv / camera.fy, 0.0));
  }
  return look;
}

std::optional<DescribedLandmark> LandmarkDescriber::described(const Landmark& landmark) const {
  const std::size_t anchor = numbers_.of(landmark.anchor);
  if (anchor == numbers_.size()) return std::nullopt;
  DescribedLandmark result;
  result.id = landmark.id;
  result.point_in_map = transformed(landmark.point_in_anchor(), nodes_[anchor].node->map_from_node);

  std::vector<std::pair<const Known*, const LandmarkSighting*>> seen;
  for (const LandmarkSighting& sighting : landmark.seen)
    if (const std::size_t number = numbers_.of(sighting.node);
        number != numbers_.size() && nodes_[number].keyframe != nullptr)
      seen.emplace_back(&nodes_[number], &sighting);
  std::sort(seen.begin(), seen.end(), [](const auto& a, const auto& b) {
    const Node &one = *a.first->node, &other = *b.first->node;
    return one.stamp.ns != other.stamp.ns ? other.stamp < one.stamp : one.id < other.id;
  });
  if (seen.size() > static_cast<std::size_t>(options_.most_views))
    seen.resize(static_cast<std::size_t>(options_.most_views));
  if (seen.empty()) return std::nullopt;
  result.updated_by = seen.front().first->node->id.session.client;

  std::vector<Look> looks;
  double sum_sigma = 0.0;
  for (const auto& [known, sighting] : seen) {
    const Eigen::Vector3d ray = result.point_in_map - known->map_from_camera.t;
    const double range = ray.norm(), depth = transformed(result.point_in_map, known->camera_from_map).z();
    if (!(depth > 0.0)) continue;
    result.direction += ray / range;
    result.nearest_m = looks.empty() ? range : std::min(result.nearest_m, range);
    result.farthest_m = std::max(result.farthest_m, range);
    sum_sigma += options_.sigma_px * (1 << std::min<int>(sighting->level, 8)) * depth / known->keyframe->geometry->fx;
    looks.push_back(look(*known, *sighting, depth));
  }
  const Look* best = nullptr;
  int least = 0;
  for (const Look& look : looks) {
    if (!look.has_feature) continue;
    int sum = 0;
    for (const Look& other : looks)
      if (other.has_feature) sum += hamming(look.descriptor, other.descriptor);
    if (best == nullptr || sum < least) {
      best = &look;
      least = sum;
    }
  }
  if (best == nullptr) return std::nullopt;
  result.descriptor = best->descriptor;
  result.feature_from_point = best->feature_from_point;
  if (result.direction.norm() > 1e-6)
    result.direction.normalize();
  else
    result.direction.setZero();
  result.sigma_m = std::max(options_.sigma_m, sum_sigma / static_cast<double>(looks.size()));
  return problem_with(result).empty() ? std::optional(result) : std::nullopt;
}

}  // namespace mapweave::matching
