#include <mapweave/core/error.h>
#include <mapweave/matching/landmark_index.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace mapweave::matching {
namespace {

constexpr double kUnitTolerance = 1e-6;  // rounding of what was encoded
constexpr double kSlack_m = 1e-6;        // rounding loses no cell

bool is_within(const Eigen::Vector3d& point, double most) {
  return point.allFinite() && point.cwiseAbs().maxCoeff() <= most;
}

std::size_t mixed(std::size_t hash, std::uint64_t value) {
  std::uint64_t h = hash ^ (value + 0x9E3779B97F4A7C15ULL + (hash << 6) + (hash >> 2));
  h ^= h >> 32;
  h *= 0xD6E8FEB86659FD93ULL;
  h ^= h >> 32;
  return static_cast<std::size_t>(h);
}

std::string problem_with(const Frustum& frustum) {
  const Pinhole& pinhole = frustum.pinhole;
  for (const double number : {pinhole.fx, pinhole.fy, pinhole.cx, pinhole.cy})
    if (!std::isfinite(number)) return "a camera's number is not finite";
  if (!(pinhole.width > 0 && pinhole.height > 0 && pinhole.fx > 0.0 && pinhole.fy > 0.0))
    return "a camera without picture or focal length";
  if (!is_within(frustum.map_from_camera.t, kMostCoordinate_m) || !frustum.map_from_camera.q.coeffs().allFinite() ||
      std::abs(frustum.map_from_camera.q.norm() - 1.0) > kUnitTolerance)
    return "a camera's pose is none, or out of reach";
  if (!(frustum.near_m > 0.0 && frustum.near_m < frustum.far_m && frustum.far_m <= kMostCoordinate_m))
    return "distances from " + std::to_string(frustum.near_m) + " to " + std::to_string(frustum.far_m) +
           " m are no range";
  return {};
}

double cross(const Eigen::Vector2d& a, const Eigen::Vector2d& b) { return a.x() * b.y() - a.y() * b.x(); }

// Counter-clockwise (Andrew's monotone chain).
std::vector<Eigen::Vector2d> convex_hull(std::vector<Eigen::Vector2d> points) {
  std::sort(points.begin(), points.end(),
            [](const auto& a, const auto& b) { return a.x() != b.x() ? a.x() < b.x() : a.y() < b.y(); });
  std::vector<Eigen::Vector2d> hull(2 * points.size());
  std::size_t size = 0;
  const auto add = [&](const Eigen::Vector2d& point, std::size_t least) {
    while (size >= least && cross(hull[size - 1] - hull[size - 2], point - hull[size - 1]) <= 0.0) --size;
    hull[size++] = point;
  };
  for (const Eigen::Vector2d& point : points) add(point, 2);
  const std::size_t lower = size + 1;
  for (auto point = points.rbegin() + 1; point != points.rend(); ++point) add(*point, lower);
  hull.resize(size > 1 ? size - 1 : size);
  return hull;
}

}  // namespace

std::string problem_with(const DescribedLandmark& landmark) {
  if (!is_within(landmark.point_in_map, kMostCoordinate_m)) return "its place is not finite, or out of reach";
  if (!is_within(landmark.feature_from_point, kMostCoordinate_m))
    return "its feature's place is not finite, or out of reach";
  const double length = landmark.direction.norm();
  if (!(length == 0.0 || std::abs(length - 1.0) < kUnitTolerance)) return "its direction is no unit vector";
  if (!(landmark.nearest_m >= 0.0 && landmark.nearest_m <= landmark.farthest_m &&
        landmark.farthest_m <= 4.0 * kMostCoordinate_m))
    return "the distances it was seen from are no range";
  if (!(landmark.sigma_m > 0.0 && landmark.sigma_m <= kMostCoordinate_m))
    return "its deviation is not a positive number";
  return {};
}

DescribedLandmark transformed(const DescribedLandmark& landmark, const Sim3& other_from_map) {
  const auto& [pose, scale] = other_from_map;
  DescribedLandmark result = landmark;
  result.point_in_map = scale * (pose.q * landmark.point_in_map) + pose.t;
  result.feature_from_point = scale * (pose.q * landmark.feature_from_point);
  result.direction = pose.q * landmark.direction;
  result.nearest_m *= scale;
  result.farthest_m *= scale;
  result.sigma_m *= scale;
  return result;
}

// One camera's frustum, ready to be compared with cells and landmarks.
class LandmarkIndex::View {
 public:
  View(const Frustum& frustum, const RetrievalOptions& options) : frustum_(frustum), options_(options) {
    map_from_camera_ = frustum.map_from_camera.q.toRotationMatrix();
    camera_from_map_ = map_from_camera_.transpose();
    least_cosine_ = std::cos(std::min(options.most_turn_rad, M_PI));
    const Pinhole& pinhole = frustum.pinhole;
    std::array<Eigen::Vector3d, 8> vertices;
    for (std::size_t i = 0; i < 8; ++i) {
      const Eigen::Vector2d pixel(i & 1 ? pinhole.width - 1.0 + options.margin_px : -options.margin_px,
                                  i & 2 ? pinhole.height - 1.0 + options.margin_px : -options.margin_px);
      vertices[i] = frustum.map_from_camera.t +
                    map_from_camera_ * (pinhole.ray(pixel) * (i & 4 ? frustum.far_m : frustum.near_m));
      low_ = i == 0 ? vertices[i] : low_.cwiseMin(vertices[i]).eval();
      high_ = i == 0 ? vertices[i] : high_.cwiseMax(vertices[i]).eval();
    }
    std::vector<Eigen::Vector2d> flat;
    for (const Eigen::Vector3d& vertex : vertices) flat.emplace_back(vertex.head<2>());
    hull_ = convex_hull(std::move(flat));
    // Corners 0 1 / 2 3 of the picture, near and (+ 4) far: three corners of each side.
    constexpr std::array<std::array<std::size_t, 3>, 6> kSides{
        {{0, 1, 2}, {4, 6, 5}, {0, 4, 1}, {2, 3, 6}, {0, 2, 4}, {1, 5, 3}}};
    const Eigen::Vector3d middle = 0.5 * (vertices[0] + vertices[7]);
    for (std::size_t i = 0; i < 6; ++i) {
      const Eigen::Vector3d& corner = vertices[kSides[i][0]];
      Eigen::Vector3d inwards = (vertices[kSides[i][1]] - corner).cross(vertices[kSides[i][2]] - corner).normalized();
      if (inwards.dot(middle - corner) < 0.0) inwards = -inwards;
      sides_[i] = {inwards, inwards.dot(corner)};
    }
  }
  const Eigen::Vector3d& low() const { return low_; }
  const Eigen::Vector3d& high() const { return high_; }

  // Exact, but for kSlack_m: separating axes of two convex outlines are normal to an edge of one of them.
  bool touches(const Eigen::Vector2d& low, const Eigen::Vector2d& high) const {
    if (low.x() > high_.x() + kSlack_m || low.y() > high_.y() + kSlack_m || high.x() < low_.x() - kSlack_m ||
        high.y() < low_.y() - kSlack_m)
      return false;
    for (std::size_t i = 0; i < hull_.size(); ++i) {
      const Eigen::Vector2d& from = hull_[i];
      const Eigen::Vector2d along = hull_[(i + 1) % hull_.size()] - from;
      // The cell's corner farthest to the left of the edge.
      const Eigen::Vector2d corner(along.y() < 0.0 ? high.x() : low.x(), along.x() > 0.0 ? high.y() : low.y());
      if (cross(along, corner - from) < -kSlack_m * along.norm()) return false;
    }
    return true;
  }
  // Never false where the frustum and the cell have a point in common.
  bool may_touch(const Eigen::Vector3d& low, const Eigen::Vector3d& high) const {
    if (low.z() > high_.z() + kSlack_m || high.z() < low_.z() - kSlack_m) return false;
    for (const auto& [inwards, offset] : sides_) {
      const Eigen::Vector3d corner((inwards.array() > 0.0).select(high.array(), low.array()));
      if (inwards.dot(corner) < offset - kSlack_m) return false;
    }
    return true;
  }

  bool shows(const Eigen::Vector3d& point) const {
    const Eigen::Vector3d ray = point - frustum_.map_from_camera.t;
    const double depth = camera_from_map_.row(2).dot(ray);
    if (!(depth >= frustum_.near_m && depth <= frustum_.far_m)) return false;
    const Eigen::Vector3d p = camera_from_map_ * ray;
    const Eigen::Vector2d pixel = frustum_.pinhole.project(p);
    const double margin = options_.margin_px;
    return pixel.x() >= -margin && pixel.y() >= -margin && pixel.x() <= frustum_.pinhole.width - 1.0 + margin &&
           pixel.y() <= frustum_.pinhole.height - 1.0 + margin;
  }
  // How alike one that is shown is seen; nothing where it was not seen from about here.
  std::optional<double> merit_of(const Eigen::Vector3d& point, const Member& member) const {
    const Eigen::Vector3d ray = point - frustum_.map_from_camera.t;
    const Eigen::Vector3d direction = member.direction.cast<double>();
    const double nearest_m = static_cast<double>(member.nearest_m), farthest_m = static_cast<double>(member.farthest_m);
    const double range = ray.norm(), cosine = ray.dot(direction) / range;
    const bool knows_direction = !direction.isZero(0.0), knows_range = farthest_m > 0.0;
    if (knows_direction && cosine < least_cosine_) return std::nullopt;
    if (knows_range &&
        (range * options_.most_range_ratio < nearest_m || range > farthest_m * options_.most_range_ratio))
      return std::nullopt;
    // The cosine of a direction that nobody knows; range counts less than direction.
    constexpr double kUnknown = 0.5, kOfRange = 0.2;
    const double apart = knows_range ? std::max({1.0, nearest_m / range, range / farthest_m}) : 1.0;
    return (knows_direction ? cosine : kUnknown) - kOfRange * (apart - 1.0);
  }

 private:
  struct Side {
    Eigen::Vector3d inwards;
    double offset;
  };
  Frustum frustum_;
  RetrievalOptions options_;
  Eigen::Matrix3d map_from_camera_, camera_from_map_;
  double least_cosine_;
  Eigen::Vector3d low_, high_;
  std::vector<Eigen::Vector2d> hull_;
  std::array<Side, 6> sides_;
};

std::size_t LandmarkIndex::CellHash::operator()(const Cell& cell) const {
  return mixed(mixed(static_cast<std::uint32_t>(cell.x), static_cast<std::uint32_t>(cell.y)),
               static_cast<std::uint32_t>(cell.z));
}

std::size_t LandmarkIndex::IdHash::operator()(const LandmarkId& id) const {
  const ClientId& client = id.session.client;
  std::size_t hash =
      mixed(std::hash<const void*>()(&client.robot.str()), std::hash<const void*>()(&client.sensor.str()));
  hash = mixed(hash, static_cast<std::uint64_t>(id.session.run));
  return mixed(hash, id.index);
}

LandmarkIndex::LandmarkIndex(LandmarkIndexOptions options) : options_(options) {
  MAPWEAVE_EXPECT(options.cell_m >= 0.05, "cells of at least 5 cm");  // so that their numbers fit
}

LandmarkIndex::Cell LandmarkIndex::cell_of(const Eigen::Vector3d& point) const {
  const auto number = [&](double coordinate) {
    return static_cast<std::int32_t>(std::floor(coordinate / options_.cell_m));
  };
  return {number(point.x()), number(point.y()), options_.spatial ? number(point.z()) : 0};
}

void LandmarkIndex::take_out(std::uint32_t slot) {
  const auto cell = cells_.find(cell_of(landmarks_[slot].point_in_map));
  auto& [points, members] = cell->second;
  const std::uint32_t place = place_in_cell_[slot];
  points[place] = points.back();
  members[place] = members.back();
  place_in_cell_[members[place].slot] = place;
  points.pop_back();
  members.pop_back();
  if (members.empty()) cells_.erase(cell);
}

void LandmarkIndex::set(const DescribedLandmark& landmark) {
  if (const std::string problem = problem_with(landmark); !problem.empty())
    throw Error(ErrorCode::kBadInput, "a landmark cannot be indexed: " + problem, to_string(landmark.id));
  const auto [known, is_new] = slots_.try_emplace(landmark.id, 0);
  if (!is_new) {
    take_out(known->second);
  } else if (!free_slots_.empty()) {
    known->second = free_slots_.back();
    free_slots_.pop_back();
  } else {
    known->second = static_cast<std::uint32_t>(landmarks_.size());
    landmarks_.emplace_back();
    place_in_cell_.emplace_back();
  }
  const std::uint32_t slot = known->second;
  const auto [session, is_first] =
      sessions_.try_emplace(landmark.id.session, static_cast<std::uint32_t>(sessions_.size()));
  if (is_first) session_of_number_.push_back(landmark.id.session);
  const std::uint32_t client =
      clients_.try_emplace(landmark.updated_by, static_cast<std::uint32_t>(clients_.size())).first->second;
  landmarks_[slot] = landmark;
  auto& [points, members] = cells_[cell_of(landmark.point_in_map)];
  place_in_cell_[slot] = static_cast<std::uint32_t>(members.size());
  points.push_back(landmark.point_in_map);
  members.push_back({landmark.direction.cast<float>(), static_cast<float>(landmark.nearest_m),
                     static_cast<float>(landmark.farthest_m), client, slot, session->second, landmark.id.index});
}

bool LandmarkIndex::remove(const LandmarkId& id) {
  const auto known = slots_.find(id);
  if (known == slots_.end()) return false;
  take_out(known->second);
  free_slots_.push_back(known->second);
  slots_.erase(known);
  return true;
}

void LandmarkIndex::clear() { *this = LandmarkIndex(options_); }

const DescribedLandmark* LandmarkIndex::find(const LandmarkId& id) const {
  const auto known = slots_.find(id);
  return known == slots_.end() ? nullptr : &landmarks_[known->second];
}

std::vector<DescribedLandmark> LandmarkIndex::retrieve(const Frustum& frustum, const RetrievalOptions& options,
                                                       const std::optional<ClientId>& asking) const {
  const auto seen = look(frustum, options, asking);
  std::vector<DescribedLandmark> result;
  result.reserve(seen.size());
  for (const Seen& one : seen) result.push_back(landmark(one));
  return result;
}

std::vector<LandmarkIndex::Seen> LandmarkIndex::look(const Frustum& frustum, const RetrievalOptions& options,
                                                     const std::optional<ClientId>& asking) const {
  MAPWEAVE_EXPECT(options.most >= 1 && options.margin_px >= 0.0 && options.most_range_ratio >= 1.0,
                  "bounds that hold something");
  std::string problem = problem_with(frustum);
  if (!problem.empty()) throw Error(ErrorCode::kBadInput, "no landmarks can be retrieved: " + problem);
  const View view(frustum, options);
  if (!is_within(view.low(), 4.0 * kMostCoordinate_m) || !is_within(view.high(), 4.0 * kMostCoordinate_m))
    throw Error(ErrorCode::kBadInput, "no landmarks can be retrieved: a frustum out of reach");

  std::vector<std::uint64_t> rank_of_session(sessions_.size());  // names are compared once, not for every answer
  std::uint64_t rank = 0;
  for (const auto& [session, number] : sessions_) rank_of_session[number] = rank++;
  const auto own = asking ? clients_.find(*asking) : clients_.end();
  const std::int64_t left_out = own == clients_.end() ? -1 : static_cast<std::int64_t>(own->second);
  std::vector<Found> found;
  const auto look_into = [&](const Members& cell) {
    for (std::size_t i = 0; i < cell.points.size(); ++i) {
      if (!view.shows(cell.points[i])) continue;
      const Member& member = cell.members[i];
      if (member.updated_by == left_out) continue;
      if (const auto merit = view.merit_of(cell.points[i], member))
        found.push_back({*merit, rank_of_session[member.session] << 32 | member.index, &cell.points[i], &member});
    }
  };
  std::vector<const Members*> looked_into;
  const double side = options_.cell_m;
  const auto low_of = [&](const Cell& cell) { return Eigen::Vector3d(cell.x * side, cell.y * side, cell.z * side); };
  const auto touches = [&](const Cell& cell) {
    const Eigen::Vector3d low = low_of(cell), high = low + Eigen::Vector3d::Constant(side);
    return view.touches(low.head<2>(), high.head<2>()) && (!options_.spatial || view.may_touch(low, high));
  };
  const Eigen::Vector3d slack = Eigen::Vector3d::Constant(kSlack_m);
  const auto within = [](const Eigen::Vector3d& corner) {
    return corner.cwiseMin(2 * kMostCoordinate_m).cwiseMax(-2 * kMostCoordinate_m);
  };
  const Cell first = cell_of(within(view.low() - slack)), last = cell_of(within(view.high() + slack));
  const double count = (1.0 + last.x - first.x) * (1.0 + last.y - first.y) * (1.0 + last.z - first.z);
  if (count > static_cast<double>(cells_.size())) {  // more than there are
    for (const auto& [cell, members] : cells_)
      if (touches(cell)) looked_into.push_back(&members);
  } else {
    for (Cell cell{first.x, 0, 0}; cell.x <= last.x; ++cell.x)
      for (cell.y = first.y; cell.y <= last.y; ++cell.y)
        for (cell.z = first.z; cell.z <= last.z; ++cell.z)
          if (touches(cell))
            if (const auto members = cells_.find(cell); members != cells_.end())
              looked_into.push_back(&members->second);
  }
  // Cells and cache lines that are fetched ahead: speed, never content.
  constexpr std::size_t kAhead = 2, kLine = 64, kLines = 8;
  for (std::size_t i = 0; i < looked_into.size(); ++i) {
    if (i + kAhead < looked_into.size()) {  // memory is what this waits for
      const Members& later = *looked_into[i + kAhead];
      const char* const points = reinterpret_cast<const char*>(later.points.data());
      const std::size_t bytes = later.points.size() * sizeof(later.points.front());
      for (std::size_t line = 0; line < kLines && line * kLine < bytes; ++line)
        __builtin_prefetch(points + line * kLine);
    }
    look_into(*looked_into[i]);
  }

  const auto by_id = [](const Found& a, const Found& b) { return a.order < b.order; };
  const auto most = static_cast<std::size_t>(options.most);
  if (found.size() > most) {
    std::nth_element(found.begin(), found.begin() + options.most, found.end(), [&](const Found& a, const Found& b) {
      return a.merit != b.merit ? a.merit > b.merit : by_id(a, b);
    });
    found.resize(most);
  }
  std::sort(found.begin(), found.end(), by_id);
  std::vector<Seen> result;
  result.reserve(found.size());
  for (const Found& one : found)
    result.push_back({one.point, one.member->session, one.member->index, one.member->slot});
  return result;
}

}  // namespace mapweave::matching
