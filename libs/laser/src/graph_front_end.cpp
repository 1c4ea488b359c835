#include "graph_front_end.h"

#include <mapweave/core/error.h>
#include <mapweave/core/log.h>

#include <Eigen/LU>
#include <algorithm>

namespace mapweave::laser {
namespace {

constexpr double kLongestExtrapolation_s = 0.5;
constexpr std::size_t kFewestPoints = 15;
constexpr double kClearShift_m = 0.08, kClearShift_rad = 0.03;
constexpr double kClearlyBetter = 0.03;  // of the mean likelihood under the points

Eigen::Matrix3d information_of(double sigma_m, double sigma_yaw_rad) {
  return Eigen::Vector3d(1.0 / (sigma_m * sigma_m), 1.0 / (sigma_m * sigma_m), 1.0 / (sigma_yaw_rad * sigma_yaw_rad)).asDiagonal();
}

Pose2 scaled(const Pose2& motion, double factor) { return {motion.x * factor, motion.y * factor, motion.phi * factor}; }

}  // namespace

void OdometryTrack::add(Stamp stamp, const Pose2& odometry_from_robot) {
  if (!readings_.empty() && !(readings_.back().first < stamp)) {
    if (readings_.back().first == stamp) readings_.back().second = odometry_from_robot;
    return;
  }
  readings_.emplace_back(stamp, odometry_from_robot);
  if (readings_.size() > 64) readings_.pop_front();
}

std::optional<Pose2> OdometryTrack::at(Stamp stamp) const {
  if (readings_.empty() || stamp < readings_.front().first) return std::nullopt;
  const auto after =
      std::lower_bound(readings_.begin(), readings_.end(), stamp, [](const auto& reading, Stamp s) { return reading.first < s; });
  if (after != readings_.end() && after->first == stamp) return after->second;
  const auto later = after != readings_.end() ? after : readings_.end() - 1;
  if (after == readings_.end() && (readings_.size() < 2 || seconds_between(later->first, stamp) > kLongestExtrapolation_s)) {
    return seconds_between(later->first, stamp) <= kLongestExtrapolation_s ? std::optional<Pose2>(later->second) : std::nullopt;
  }
  const auto earlier = later - 1;
  const double span = seconds_between(earlier->first, later->first);
  const double share = seconds_between(earlier->first, stamp) / span;
  // Going on as before only where "before" is recent.
  if (after == readings_.end() && span > kLongestExtrapolation_s) return later->second;
  return compose(earlier->second, scaled(between(earlier->second, later->second), share));
}

void FrontEnd::add_odometry(const OdometryInput& odometry) { odometry_.add(odometry.stamp, planar(odometry.odometry_from_robot)); }

Pose2 FrontEnd::predict(Stamp stamp, bool& from_odometry) const {
  const auto odometry = odometry_.at(stamp);
  from_odometry = odometry.has_value() && last_odometry_.has_value();
  if (from_odometry) return between(*last_odometry_, *odometry);
  const double seconds = std::clamp(seconds_between(*last_stamp_, stamp), 0.0, 1.0);
  return scaled(last_motion_, seconds);
}

int FrontEnd::add_scan(const ScanInput& input, Map& map) {
  const NodeId id{session_, next_node_++};
  Node node{id, input.stamp, {}, nullptr};
  const auto points = matching::wall_points(input.scan, options_.min_range_m, options_.max_range_m);
  const auto few = matching::thinned(points, options_.thinning_m, static_cast<std::size_t>(options_.most_points));

  bool inserted = false;
  int frozen = 0;
  if (!last_stamp_) {
    inserted = few.size() >= kFewestPoints;
  } else {
    bool from_odometry = false;
    const Pose2 motion = predict(input.stamp, from_odometry);
    const double distance = std::hypot(motion.x, motion.y), turn = std::abs(motion.phi);
    const Pose2 predicted = compose(local_from_last_, motion);
    Pose2 local_from_node = predicted;
    matching::PriorWeight prior{options_.odometry_sigma_m + options_.odometry_sigma_per_m * distance,
                                options_.odometry_sigma_yaw_rad + options_.odometry_sigma_yaw_per_rad * turn};
    if (from_odometry) {
      heading_quality_.add_step(distance, motion.phi, prior.sigma_yaw_rad);
      prior.sigma_yaw_rad *= heading_quality_.factor();
    } else {
      prior = {0.15 + 0.3 * distance, 0.1 + 0.3 * turn};
      heading_quality_.add_heading(std::nullopt);
    }

    bool matched = false;
    Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
    if (few.size() >= kFewestPoints && !active_.empty()) {
      Active& against = active_.front();
      against.field.settle();
      const Pose2 guess = between(against.local_from_submap, predicted);
      matching::SearchWindow window{options_.window_m + 0.25 * distance, options_.window_yaw_rad + 0.25 * turn, 0.00873};
      if (!from_odometry) window.radius_m += 0.2, window.yaw_rad += 0.15;
      window.radius_m = std::min(window.radius_m, 2.0);
      const matching::PriorWeight loose{std::max(0.05, 2 * prior.sigma_m), std::max(0.06, 2 * prior.sigma_yaw_rad)};
      auto coarse = matching::correlate(against.field, few, guess, window, loose);
      if (coarse && coarse->at_border && coarse->score < 0.6) {
        window.yaw_rad *= 2, window.radius_m *= 1.5;
        coarse = matching::correlate(against.field, few, guess, window, loose);
      }
      if (coarse) {
        // The points share errors; so that the prior weighs against them as it should, it is scaled instead.
        const double scale = std::sqrt(options_.point_information_scale);
        const matching::PriorWeight relative{prior.sigma_m * scale, prior.sigma_yaw_rad * scale, 9.0 / options_.point_information_scale};
        auto match = matching::refine(against.field, few, coarse->field_from_scan, guess, &relative);
        // Along bare corridors all places look alike, and the best by a hair is anywhere: walls must tell clearly that odometry is wrong.
        const Pose2 shift = between(guess, coarse->field_from_scan);
        if (from_odometry && (std::hypot(shift.x, shift.y) > kClearShift_m || std::abs(shift.phi) > kClearShift_rad)) {
          const auto as_expected = matching::refine(against.field, few, guess, guess, &relative);
          if (as_expected.inliers >= options_.min_inliers && as_expected.score > match.score - kClearlyBetter) match = as_expected;
        }
        if (from_odometry && heading_quality_.wants_heading()) {
          const auto free = matching::refine(against.field, few, coarse->field_from_scan, {}, nullptr);
          heading_quality_.add_heading(free.inliers >= options_.min_inliers
                                           ? std::optional(against.local_from_submap.phi + free.field_from_scan.phi)
                                           : std::nullopt);
        }
        if (match.inliers >= options_.min_inliers) {
          matched = true;
          local_from_node = compose(against.local_from_submap, match.field_from_scan);
          information = options_.point_information_scale * match.information;
          const Eigen::Matrix3d floor = Eigen::Vector3d(2.5e-5, 2.5e-5, 7.6e-7).asDiagonal();  // 5 mm, 0.05 degrees
          information = ((Eigen::Matrix3d::Identity() + information * floor).inverse() * information).eval();
          information = (0.5 * (information + information.transpose())).eval();
          const ConstraintId name{ConstraintKind::scan_match, map.submaps.find(against.id)->anchor(), id, 0};
          map.constraints.set(name, planar_constraint(name, match.field_from_scan, information));
        }
      }
    }
    const Pose2 moved = between(local_from_last_, local_from_node);
    if (from_odometry || !matched) {
      // Without odometry and without a match nothing is known but that robots are slow.
      const double seconds = std::max(0.1, seconds_between(*last_stamp_, input.stamp));
      // What scans found to be wrong by far is told as wrong as that.
      const double missed = matched ? std::abs(wrap_angle(moved.phi - motion.phi)) : 0.0;
      const double sigma_yaw = missed > 3.0 * prior.sigma_yaw_rad ? std::max(missed, prior.sigma_yaw_rad) : prior.sigma_yaw_rad;
      const Eigen::Matrix3d known = from_odometry ? information_of(prior.sigma_m, sigma_yaw) : information_of(0.5 * seconds, 0.5 * seconds);
      const ConstraintId name{ConstraintKind::odometry, *last_node_, id, 0};
      map.constraints.set(name, planar_constraint(name, motion, known));
    }
    const double seconds = seconds_between(*last_stamp_, input.stamp);
    if (seconds > 1e-3) last_motion_ = scaled(moved, 1.0 / seconds);
    travelled_m_ += std::hypot(moved.x, moved.y);
    local_from_last_ = local_from_node;
    const Pose2 since = between(local_from_inserted_, local_from_node);
    if (few.size() < kFewestPoints) {
      // Nothing seen, nothing to draw.
    } else if (active_.empty()) {
      inserted = true;
    } else if (matched || from_odometry) {
      // New ground fits nothing yet: there odometry draws.
      inserted = std::hypot(since.x, since.y) > options_.insert_distance_m || std::abs(since.phi) > options_.insert_yaw_rad;
      lost_ = 0;
    } else if (++lost_ >= options_.lost_scans) {
      // A scan that fits nowhere would only spoil the submap; where it goes on like that, a new one begins, which loops may tie to the
      // others.
      log(LogLevel::warning, "robot " + session_.client.robot.str() + ": " + std::to_string(lost_) +
                                 " scans fit nowhere and there is no odometry; a new piece of map begins at " +
                                 std::to_string(input.stamp.seconds()) + " s, its place uncertain");
      frozen += finish(map);
      inserted = true;
      lost_ = 0;
    }
  }
  last_stamp_ = input.stamp;
  last_odometry_ = odometry_.at(input.stamp);
  last_node_ = id;
  node.map_from_node = spatial(local_from_last_);
  if (inserted) node.payload = std::make_shared<const Payload>(input.scan);
  map.nodes.set(id, node);
  if (inserted) {
    local_from_inserted_ = local_from_last_;
    if (active_.empty()) start_submap(local_from_last_, map);
    insert(node, points, map);
    // The older is done after its length; the younger starts half-way.
    const auto spent = [&](const Active& active) {
      return std::max((travelled_m_ - active.started_at_m) / options_.submap_length_m,
                      static_cast<double>(active.scans) / options_.submap_scans);
    };
    if (active_.size() == 1 && spent(active_.front()) >= 0.5) {
      start_submap(local_from_last_, map);
      insert(node, points, map);
    }
    if (spent(active_.front()) >= 1.0 && active_.size() == 2) {
      freeze(active_.front(), map);
      active_.pop_front();
      ++frozen;
    }
  }
  return frozen;
}

void FrontEnd::start_submap(const Pose2& local_from_node, Map& map) {
  Active active{{session_, next_submap_++}, local_from_node, travelled_m_, 0, {}};
  Submap submap;
  submap.id = active.id;
  map.submaps.set(submap.id, submap);
  active_.push_back(std::move(active));
}

// Into every active submap that does not hold the node yet.
void FrontEnd::insert(const Node& node, const std::vector<matching::WallPoint>& points, Map& map) {
  const Pose2 local_from_node = planar(node.map_from_node);
  for (auto& active : active_) {
    Submap& submap = *map.submaps.find(active.id);
    if (!submap.submap_from_node.empty() && submap.submap_from_node.back().first == node.id) continue;
    const Pose2 submap_from_node = submap.submap_from_node.empty() ? Pose2{} : between(active.local_from_submap, local_from_node);
    submap.submap_from_node.emplace_back(node.id, spatial(submap_from_node));
    ++active.scans;
    active.field.add(matching::placed(submap_from_node, points));
  }
}

void FrontEnd::freeze(Active& active, Map& map) {
  Submap& submap = *map.submaps.find(active.id);
  submap.frozen = true;
  submap.content = content_hash(submap, map.nodes);
}

int FrontEnd::finish(Map& map) {
  const int frozen = active_.empty() ? 0 : 1;
  for (std::size_t i = 0; i < active_.size(); ++i) {
    if (i > 0) {
      // The younger one began inside the older and holds nothing else.
      map.submaps.erase(active_[i].id);
      continue;
    }
    freeze(active_[i], map);
  }
  active_.clear();
  return frozen;
}

}  // namespace mapweave::laser
