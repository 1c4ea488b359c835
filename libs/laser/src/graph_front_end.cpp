#include "graph_front_end.h"
#include "even_motion.h"

#include <mapweave/core/error.h>
#include <mapweave/core/log.h>
#include <mapweave/maps/map_noise.h>

#include <Eigen/LU>
#include <algorithm>

namespace mapweave::laser {
namespace {

constexpr std::size_t kFewestPoints = 15;  // of a scan: fewer are not matched or inserted
// From odometry, and of the mean likelihood under the points: a search that moves less than the first needs no clear
// walls; one that moves farther has to gain the second, or the place that odometry names is kept. Larger gains let
// wheels that are wrong mislead, smaller ones bare corridors (DECISIONS.md, 21).
constexpr double kClearShift_m = 0.08, kClearShift_rad = 0.03, kClearlyBetter = 0.03;
constexpr double kShortestMotion_s = 0.02;  // that odometry is divided by: readings resolve no shorter one
constexpr double kSuddenly_rad = 0.02;      // another turn than before, within a sweep
constexpr double kLessBent = 0.01;  // of the mean likelihood: gained by going on as before, where wheels slipped
constexpr double kMatters_rad = 0.004, kMatters_m = 0.01;  // within a sweep; less than a match resolves
// Without odometry the robot is expected to go on as it did: it may have braked or begun to turn.
constexpr double kBlindSigma_m = 0.15, kBlindSigma_per_m = 0.3, kBlindSigma_rad = 0.1, kBlindSigma_per_rad = 0.3;
constexpr double kLongestBlind_s = 1.0;  // that it is expected to go on for
// The constraint that stands for a motion without odometry: a standard deviation of 0.5 m and 0.5 rad a second.
constexpr double kSlow_per_s = 0.5, kShortestSlow_s = 0.1;
// Windows grow by that share of the motion, since odometry errs in proportion, and by the others where there is none.
// The step of the turn moves a wall at 6 m by one cell. The bound keeps a robot that jumps from searching for seconds.
constexpr double kWindowShare = 0.25, kWindowStep_rad = 0.00873, kBlindWindow_m = 0.2, kBlindWindow_rad = 0.15,
                 kWidestWindow_m = 2.0;
// In the search, odometry costs score with the square of twice its standard deviations, and these at least.
constexpr double kSearchSigmas = 2.0, kLeastSearchSigma_m = 0.05, kLeastSearchSigma_rad = 0.06;
// What ends at the rim of its window and fits worse than that lies beyond, most likely: a second search, so much wider.
constexpr double kPoorFit = 0.6, kWiderTurn = 2.0, kWiderShift = 1.5;
constexpr double kGate = 9.0;          // squared: past three sigmas odometry is slip, and gives way (DECISIONS.md, 6)
constexpr double kContradicted = 3.0;  // sigmas: as the gate; a turn that the match finds otherwise is the match's
// Of the points of a scan, relative to points with independent errors, where matches are as good as that: more is worth
// nothing on any log, and walls that are not flat mislead all points together (DECISIONS.md, 118).
constexpr double kMostPointInformation = 0.5;
constexpr double kBestMatch_m2 = 2.5e-5, kBestMatch_rad2 = 7.6e-7;  // no match is surer than 5 mm and 0.05 degrees
constexpr double kNoTime_s = 1e-3;                                  // scans as near in time have no speed

Pose2 scaled(const Pose2& motion, double factor) { return {motion.x * factor, motion.y * factor, motion.phi * factor}; }

Stamp later(Stamp stamp, double seconds) { return {stamp.ns + std::llround(seconds * 1e9)}; }

}  // namespace

void FrontEnd::add_odometry(const OdometryInput& odometry) {
  odometry_.add(odometry.stamp, planar(odometry.odometry_from_robot));
}

Pose2 FrontEnd::predict(Stamp stamp, bool& from_odometry) const {
  const auto odometry = odometry_.at(taken_at(stamp));
  from_odometry = odometry.has_value() && last_odometry_.has_value();
  if (from_odometry) return between(*last_odometry_, *odometry);
  const double seconds = std::clamp(seconds_between(*last_stamp_, stamp), 0.0, kLongestBlind_s);
  return scaled(last_motion_, seconds);
}

// Lasers whose sweep is not known keep the older thinning, and so their maps, byte for byte.
std::vector<matching::WallPoint> FrontEnd::matched_points(const PackedScan& scan,
                                                          const std::vector<matching::WallPoint>& all) const {
  const auto most = static_cast<std::size_t>(options_.most_points);
  return scan.geometry->has_sweep() ? matching::thinned_evenly(all, options_.thinning_m, most)
                                    : matching::thinned(all, options_.thinning_m, most);
}

FrontEnd::Step FrontEnd::next_step(Stamp stamp) {
  Step step;
  step.motion = predict(stamp, step.from_odometry);
  step.distance_m = std::hypot(step.motion.x, step.motion.y);
  step.turn_rad = std::abs(step.motion.phi);
  step.seconds = seconds_between(*last_stamp_, stamp);
  step.measured_turn_rad = inertial_.turn(taken_at(*last_stamp_), taken_at(stamp));
  step.prior = {options_.odometry_sigma_m + options_.odometry_sigma_per_m * step.distance_m,
                options_.odometry_sigma_yaw_rad + options_.odometry_sigma_yaw_per_rad * step.turn_rad};
  if (step.from_odometry) {
    heading_quality_.add_step(step.distance_m, step.motion.phi, step.prior.sigma_yaw_rad);
    step.prior.sigma_yaw_rad *= heading_quality_.factor();
  } else {
    step.prior = {kBlindSigma_m + kBlindSigma_per_m * step.distance_m,
                  kBlindSigma_rad + kBlindSigma_per_rad * step.turn_rad};
    heading_quality_.add_gap();
  }
  turn_by_unit(step);
  step.predicted = compose(local_from_last_, step.motion);
  return step;
}

// Once the inertial unit is believed it says how far the robot turned. Wheels that agree with it count by what they are
// worth; those that slipped do not.
void FrontEnd::turn_by_unit(Step& step) const {
  constexpr double kAgree = 2.0;  // standard deviations: wheels farther off slipped, more likely than not
  if (!step.measured_turn_rad || !calibration_.is_believed()) return;
  double turn = calibration_.turn_rad(step.seconds, *step.measured_turn_rad);
  double sigma = calibration_.turn_sigma_rad(step.seconds, turn);
  const double by_wheels_sigma = step.prior.sigma_yaw_rad, apart = wrap_angle(step.motion.phi - turn);
  if (step.from_odometry && std::abs(apart) < kAgree * std::hypot(sigma, by_wheels_sigma)) {
    const double both = std::hypot(sigma, by_wheels_sigma);
    turn += apart * sigma * sigma / (both * both);
    sigma *= by_wheels_sigma / both;
  }
  // A robot drives along an arc, and its chord turns by half.
  const double half = 0.5 * wrap_angle(turn - step.motion.phi);
  step.motion = {std::cos(half) * step.motion.x - std::sin(half) * step.motion.y,
                 std::sin(half) * step.motion.x + std::cos(half) * step.motion.y, wrap_angle(turn)};
  step.turn_rad = std::abs(step.motion.phi);
  step.prior.sigma_yaw_rad = sigma;
  step.from_unit = true;
}

double FrontEnd::point_information_scale() const {
  const double least = options_.point_information_scale, most = std::max(least, kMostPointInformation);
  return std::clamp(heading_quality_.match_information().value_or(least), least, most);
}

FrontEnd::Matched FrontEnd::match(const std::vector<matching::WallPoint>& few, const Step& step) {
  Matched result;
  if (few.size() < kFewestPoints || active_.empty()) return result;
  Active& against = active_.front();
  against.field.settle();
  const Pose2 guess = between(against.local_from_submap, step.predicted);
  matching::SearchWindow window{options_.window_m + kWindowShare * step.distance_m,
                                options_.window_yaw_rad + kWindowShare * step.turn_rad, kWindowStep_rad};
  if (!step.from_odometry) {
    window.radius_m += kBlindWindow_m;
    if (!step.from_unit) window.yaw_rad += kBlindWindow_rad;
  }
  window.radius_m = std::min(window.radius_m, kWidestWindow_m);
  const matching::PriorWeight loose{std::max(kLeastSearchSigma_m, kSearchSigmas * step.prior.sigma_m),
                                    std::max(kLeastSearchSigma_rad, kSearchSigmas * step.prior.sigma_yaw_rad)};
  auto coarse = matching::correlate(against.field.likelihood(), few, guess, window, loose);
  if (coarse && coarse->at_border && coarse->score < kPoorFit) {
    window.yaw_rad *= kWiderTurn;
    window.radius_m *= kWiderShift;
    coarse = matching::correlate(against.field.likelihood(), few, guess, window, loose);
  }
  if (!coarse) return result;
  result.coarse = coarse->field_from_scan;
  // The points share errors; so that the prior weighs against them as it should, it is scaled instead. In the graph
  // odometry is scaled (motion_constraint): how good the next match is says nothing of what the whole submap is bent
  // by.
  const double information_scale = point_information_scale(), scale = std::sqrt(information_scale);
  const matching::PriorWeight relative{step.prior.sigma_m * scale, step.prior.sigma_yaw_rad * scale,
                                       kGate / information_scale};
  auto match = matching::refine(against.field, few, coarse->field_from_scan, guess, &relative);
  // Along bare corridors all places look alike, and the best by a hair is anywhere: walls must show clearly that
  // odometry is wrong.
  const Pose2 shift = between(guess, coarse->field_from_scan);
  if (step.from_odometry && (std::hypot(shift.x, shift.y) > kClearShift_m || std::abs(shift.phi) > kClearShift_rad)) {
    const auto as_expected = matching::refine(against.field, few, guess, guess, &relative);
    if (as_expected.inliers >= options_.min_inliers && as_expected.score > match.score - kClearlyBetter)
      match = as_expected;
  }
  if (match.inliers < options_.min_inliers) return result;
  result.is_found = true;
  result.score = match.score;
  result.submap_from_node = match.field_from_scan;
  result.local_from_node = compose(against.local_from_submap, match.field_from_scan);
  const double heading_scale = std::sqrt(options_.point_information_scale);
  const Eigen::Matrix3d spread = Eigen::Vector3d(scale, scale, heading_scale).asDiagonal();
  result.information = spread * match.information * spread;
  const Eigen::Matrix3d floor = Eigen::Vector3d(kBestMatch_m2, kBestMatch_m2, kBestMatch_rad2).asDiagonal();
  result.information =
      ((Eigen::Matrix3d::Identity() + result.information * floor).inverse() * result.information).eval();
  result.information = (0.5 * (result.information + result.information.transpose())).eval();
  return result;
}

// By a match that knows of nothing but the walls.
std::optional<MatchedHeading> FrontEnd::free_heading(const std::vector<matching::WallPoint>& few,
                                                     const Pose2& submap_from_scan) const {
  const Active& against = active_.front();
  const auto free = matching::refine(against.field, few, submap_from_scan, {}, nullptr);
  if (free.inliers < options_.min_inliers) return std::nullopt;
  // Along a bare wall the place is open: a little information makes the matrix one that has an inverse.
  const Eigen::Matrix3d covariance = (free.information + 1e-3 * Eigen::Matrix3d::Identity()).inverse();
  return MatchedHeading{against.local_from_submap.phi + free.field_from_scan.phi, std::sqrt(covariance(2, 2))};
}

// How good odometry, the matches and the inertial unit are at headings.
void FrontEnd::learn_heading(const Taken& taken, const Step& step, const Matched& found) {
  if (step.measured_turn_rad && found.is_found)
    calibration_.add_step(step.seconds, *step.measured_turn_rad,
                          wrap_angle(found.local_from_node.phi - local_from_last_.phi));
  else
    calibration_.add_gap();
  const bool of_wheels = step.from_odometry && heading_quality_.wants_heading();
  const bool of_unit = step.measured_turn_rad && calibration_.wants_heading();
  if (!found.coarse || !(of_wheels || of_unit)) return;
  const std::optional<MatchedHeading> matched = free_heading(taken.few, *found.coarse);
  if (of_wheels) heading_quality_.add_heading(matched);
  if (of_unit) calibration_.add_heading(matched ? std::optional(matched->heading_rad) : std::nullopt);
}

bool FrontEnd::awaits_inertial(const ScanInput& input) const {
  const auto latest = inertial_.latest();
  const Stamp taken = taken_at(input.stamp);
  return calibration_.is_believed() && latest && *latest < taken && seconds_between(*latest, taken) < kInertialGap_s;
}

double FrontEnd::needs_until_s(const ScanInput& input) const {
  const ScanGeometry& geometry = *input.scan.geometry;
  return std::max({geometry.ray_time_s(0), geometry.ray_time_s(geometry.ray_count - 1), 0.0}) -
         static_cast<double>(delay_ns_) * 1e-9;
}

Pose2 FrontEnd::sweep_velocity(const ScanInput& input) const {
  const ScanGeometry& geometry = *input.scan.geometry;
  const double first_s = geometry.ray_time_s(0), last_s = geometry.ray_time_s(geometry.ray_count - 1);
  // Shorter than this, readings do not resolve the motion.
  const double middle_s = 0.5 * (first_s + last_s),
               half_s = std::max(kShortestMotion_s, 0.5 * std::abs(last_s - first_s));
  const Stamp from = later(taken_at(input.stamp), middle_s - half_s),
              to = later(taken_at(input.stamp), middle_s + half_s);
  Pose2 velocity = last_motion_;
  const auto before = odometry_.at(from), after = odometry_.at(to);
  if (before && after && from < to) {
    const Pose2 motion = between(*before, *after);
    velocity = scaled(motion, 0.5 / half_s);
    // A robot drives along an arc, and the chord leaves at half of the turn.
    const double turn = -velocity.phi * half_s;
    velocity = {std::cos(turn) * velocity.x - std::sin(turn) * velocity.y,
                std::sin(turn) * velocity.x + std::cos(turn) * velocity.y, velocity.phi};
  }
  if (calibration_.is_believed())
    if (const auto turn = inertial_.turn(from, to))
      velocity.phi = calibration_.turn_rad(2.0 * half_s, *turn) * 0.5 / half_s;
  return is_finite(velocity) ? velocity : Pose2{};  // odometry may be absurd
}

std::optional<Pose2> FrontEnd::motion_after(Stamp stamp, double seconds) const {
  const Stamp start = taken_at(stamp), then = later(start, seconds);
  const auto before = odometry_.at(start), after = odometry_.at(then);
  if (!before || !after) return std::nullopt;
  Pose2 motion = between(*before, *after);
  if (calibration_.is_believed())
    if (const auto turn = seconds < 0.0 ? inertial_.turn(then, start) : inertial_.turn(start, then))
      motion.phi = std::copysign(1.0, seconds) * calibration_.turn_rad(std::abs(seconds), *turn);
  return motion;
}

// Where the match found that the robot moved otherwise than was taken for its motion during the sweep.
std::optional<Pose2> FrontEnd::corrected_velocity(const ScanInput& input, const Pose2& velocity, const Step& step,
                                                  const Matched& found) const {
  const double seconds = seconds_between(*last_stamp_, input.stamp);
  if (seconds < kNoTime_s || seconds > kLongestStep_s) return std::nullopt;
  const Pose2 moved = between(local_from_last_, found.local_from_node);
  Pose2 better = velocity;
  if (!step.from_odometry) {
    better = scaled(moved, 1.0 / seconds);
    if (step.from_unit) better.phi = velocity.phi;
  } else if (!step.from_unit) {
    const double missed = wrap_angle(moved.phi - step.motion.phi);
    if (std::abs(missed) > kContradicted * step.prior.sigma_yaw_rad) better.phi += missed / seconds;
  }
  const ScanGeometry& geometry = *input.scan.geometry;
  const double sweep_s = std::abs(geometry.ray_time_s(geometry.ray_count - 1) - geometry.ray_time_s(0));
  const bool matters = std::abs(better.phi - velocity.phi) * sweep_s > kMatters_rad ||
                       std::hypot(better.x - velocity.x, better.y - velocity.y) * sweep_s > kMatters_m;
  return matters && is_finite(better) ? std::optional(better) : std::nullopt;
}

FrontEnd::Taken FrontEnd::take(const ScanInput& given) const {
  Taken taken{given, {}, {}, {}};
  PackedScan& scan = taken.input.scan;
  if (scan.geometry->has_sweep()) {
    taken.velocity = sweep_velocity(taken.input);
    scan.motion = sweep_motion(taken.velocity);
    even_out(scan, [&](double seconds) { return motion_after(given.stamp, seconds); });
  }
  see(taken);
  return taken;
}

void FrontEnd::see(Taken& taken) const {
  taken.points = matching::wall_points(taken.input.scan, options_.min_range_m, options_.max_range_m);
  taken.few = matched_points(taken.input.scan, taken.points);
}

// Wheels that slip while the laser turns bend the scan, and only the next step shows the slip: where they say that the
// robot suddenly turns otherwise, the scan is also matched as if it had gone on as before.
bool FrontEnd::turns_suddenly(const Taken& taken, const Step& step) const {
  const ScanGeometry& geometry = *taken.input.scan.geometry;
  const double sweep_s = std::abs(geometry.ray_time_s(geometry.ray_count - 1) - geometry.ray_time_s(0));
  return step.from_odometry && !step.from_unit && step.seconds < kLongestStep_s &&
         std::abs(taken.velocity.phi - last_motion_.phi) * sweep_s > kSuddenly_rad;
}

// The scan under another motion during the sweep, matched again.
FrontEnd::Matched FrontEnd::match_moving(const ScanInput& scan, const Pose2& velocity, Taken& taken, const Step& step) {
  taken.input = scan;
  taken.input.scan.motion = sweep_motion(velocity);
  see(taken);
  return match(taken.few, step);
}

// If the match implies another motion during the sweep, the scan is undistorted with it, kept so, and matched again.
FrontEnd::Matched FrontEnd::match_sweep(const ScanInput& given, Taken& taken, const Step& step) {
  Matched found = match(taken.few, step);
  const auto attempt = [&](const ScanInput& scan, const Pose2& velocity, double gain) {
    Taken other = taken;
    const Matched again = match_moving(scan, velocity, other, step);
    if (!again.is_found || again.score < found.score + gain) return;
    taken = std::move(other);
    found = again;
  };
  if (taken.input.scan.geometry->has_sweep() && found.is_found) {
    if (turns_suddenly(taken, step)) attempt(given, last_motion_, kLessBent);
    if (const auto better = corrected_velocity(taken.input, taken.velocity, step, found)) {
      if (step.from_odometry)
        attempt(taken.input, *better, 0.0);
      else
        found = match_moving(taken.input, *better, taken, step);
    }
  }
  learn_heading(taken, step, found);
  return found;
}

Constraint FrontEnd::motion_constraint(const NodeId& id, const Step& step,
                                       const std::optional<Pose2>& matched_motion) const {
  // Without odometry and without a match nothing is known but that robots are slow.
  const double seconds = std::max(kShortestSlow_s, step.seconds), slow = kSlow_per_s * seconds;
  // If the match contradicts odometry's heading by more than kContradicted sigmas, the difference becomes the sigma.
  const double missed = matched_motion ? std::abs(wrap_angle(matched_motion->phi - step.motion.phi)) : 0.0;
  // What odometry is worth beside a match, whose information in the graph is not scaled by how good matches are.
  const double scale = matched_motion ? std::sqrt(point_information_scale() / options_.point_information_scale) : 1.0;
  const double prior_yaw = scale * step.prior.sigma_yaw_rad;
  const double sigma_yaw = missed > kContradicted * prior_yaw ? std::max(missed, prior_yaw) : prior_yaw;
  const Eigen::Matrix3d known = step.from_odometry ? planar_information(step.prior.sigma_m, sigma_yaw)
                                                   : planar_information(slow, step.from_unit ? sigma_yaw : slow);
  return planar_constraint({ConstraintKind::odometry, *last_node_, id, 0}, step.motion, known);
}

// From the last scan to this one. False where neither a match nor odometry says where it is.
bool FrontEnd::follow(const NodeId& id, const ScanInput& given, Taken& taken, Map& map) {
  const Stamp stamp = taken.input.stamp;
  const Step step = next_step(stamp);
  const Matched found = match_sweep(given, taken, step);
  const bool matched = last_is_matched_ = found.is_found;
  const Pose2 local_from_node = matched ? found.local_from_node : step.predicted;
  const Pose2 moved = between(local_from_last_, local_from_node);
  if (matched) {
    const ConstraintId name{ConstraintKind::scan_match, map.submaps.find(active_.front().id)->anchor(), id, 0};
    map.constraints.set(name, planar_constraint(name, found.submap_from_node, found.information));
  }
  if (step.from_odometry || step.from_unit || !matched) {
    const Constraint motion = motion_constraint(id, step, matched ? std::optional(moved) : std::nullopt);
    map.constraints.set(motion.id, motion);
  }
  if (step.seconds > kNoTime_s) last_motion_ = scaled(moved, 1.0 / step.seconds);
  travelled_m_ += std::hypot(moved.x, moved.y);
  local_from_last_ = local_from_node;
  return matched || step.from_odometry;
}

int FrontEnd::add_scan(const ScanInput& given, Map& map) {
  Taken taken = take(given);
  const Stamp stamp = taken.input.stamp;
  const NodeId id{session_, next_node_++};
  const bool is_placed = !last_stamp_ || follow(id, given, taken, map);
  bool is_drawn = taken.few.size() >= kFewestPoints;  // nothing seen, nothing to draw
  int frozen = 0;
  if (is_drawn && !active_.empty()) {
    const Pose2 since = between(local_from_inserted_, local_from_last_);
    // New ground fits nothing yet: there odometry draws.
    is_drawn = is_placed && (std::hypot(since.x, since.y) > options_.insert_distance_m ||
                             std::abs(since.phi) > options_.insert_yaw_rad);
    lost_ = is_placed ? 0 : lost_ + 1;
    if (!is_placed && lost_ >= options_.lost_scans) {
      // A scan that fits nowhere would only spoil the submap; where it goes on like that, a new one begins, which loops
      // may connect to the others.
      log(LogLevel::warning, "robot " + session_.client.robot.str() + ": " + std::to_string(lost_) +
                                 " scans fit nowhere and there is no odometry; a new piece of map begins at " +
                                 std::to_string(stamp.seconds()) + " s, its place uncertain");
      frozen += finish(map);
      is_drawn = true;
      lost_ = 0;
    }
  }
  last_stamp_ = stamp;
  last_odometry_ = odometry_.at(taken_at(stamp));
  last_node_ = id;
  Node node{id, stamp, spatial(local_from_last_), nullptr};
  if (is_drawn) node.payload = std::make_shared<const Payload>(taken.input.scan);
  map.nodes.set(id, node);
  if (is_drawn) frozen += draw(node, taken.points, map);
  return frozen;
}

// The older submap is done after its length; the younger starts half-way.
int FrontEnd::draw(const Node& node, const std::vector<matching::WallPoint>& points, Map& map) {
  local_from_inserted_ = local_from_last_;
  if (active_.empty()) start_submap(local_from_last_, map);
  insert(node, points, map);
  const auto spent = [&](const Active& active) {
    return std::max((travelled_m_ - active.started_at_m) / options_.submap_length_m,
                    static_cast<double>(active.scans) / options_.submap_scans);
  };
  if (active_.size() == 1 && spent(active_.front()) >= 0.5) {
    start_submap(local_from_last_, map);
    insert(node, points, map);
  }
  if (spent(active_.front()) < 1.0 || active_.size() != 2) return 0;
  freeze(active_.front(), map);
  active_.pop_front();
  return 1;
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
    const Pose2 submap_from_node =
        submap.submap_from_node.empty() ? Pose2{} : between(active.local_from_submap, local_from_node);
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
