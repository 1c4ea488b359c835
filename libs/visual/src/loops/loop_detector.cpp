#include "loop_detector.h"

#include "judged_place.h"
#include "loop_claims.h"
#include "map_correction.h"

#include <mapweave/maps/map_noise.h>
#include <mapweave/matching/alignment_search.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <queue>

namespace mapweave::visual {
namespace {

constexpr std::uint32_t kLatest = 10;       // keyframes that are no loop
constexpr std::uint32_t kRemembered = 500;  // for which it is remembered, where nothing but claims can connect sessions
constexpr std::size_t kLookedUp = 12;       // most alike of all, of which kJudged places are judged
constexpr std::size_t kCovisible = 4;       // keyframes that speak with the one that looks alike
constexpr double kLeastAlike = 0.3;         // of the likeness of consecutive keyframes, as fusion.visual.least_alike
constexpr double kApart_m = 1.0;            // claims that contradict each other
constexpr int kLeastShared = kCovisibleMotion.least_shared;

NodeId id_of(int keyframe) {
  NodeId id;
  id.index = static_cast<std::uint32_t>(keyframe);
  return id;
}

// Of two sessions, the keyframes with the least time between them.
std::pair<int, int> nearest_in_time(const LandmarkMap& map, int session, int other) {
  const std::vector<int> order = keyframes_in_order(map, session, other);
  std::pair<int, int> nearest{order.front(), order.back()};
  double least_s = std::numeric_limits<double>::infinity();
  for (std::size_t i = 1; i < order.size(); ++i) {
    const Keyframe &a = map.keyframe(order[i - 1]), &b = map.keyframe(order[i]);
    if (a.session == b.session || !(seconds_between(a.stamp, b.stamp) < least_s)) continue;
    least_s = seconds_between(a.stamp, b.stamp);
    nearest = a.session == session ? std::pair(order[i - 1], order[i]) : std::pair(order[i], order[i - 1]);
  }
  return nearest;
}

}  // namespace

std::vector<int> keyframes_in_order(const LandmarkMap& map, int session, int other) {
  std::vector<int> order;
  for (int number = 0; number < static_cast<int>(map.keyframes.size()); ++number)
    if (const Keyframe& k = map.keyframe(number); !k.gone && (k.session == session || k.session == other))
      order.push_back(number);
  std::sort(order.begin(), order.end(), [&](int a, int b) { return map.keyframe(a).serial < map.keyframe(b).serial; });
  return order;
}

std::vector<CovisibilityEdge> covisibility_edges(const LandmarkMap& map, int session, int least_landmarks) {
  const std::vector<int> order = keyframes_in_order(map, session, session);
  std::vector<CovisibilityEdge> edges;
  for (std::size_t i = 1; i < order.size(); ++i) {
    bool to_the_last = false;
    for (const CovisibleKeyframe& shared : covisible(map, order[i])) {
      if (map.keyframe(shared.keyframe).serial > map.keyframe(order[i]).serial || shared.landmarks < least_landmarks)
        continue;
      edges.push_back({shared.keyframe, order[i], shared.landmarks});
      to_the_last = to_the_last || shared.keyframe == order[i - 1];
    }
    if (!to_the_last) edges.push_back({order[i - 1], order[i], 0});
  }
  return edges;
}

double path_between(const LandmarkMap& map, int from, int to) {
  std::vector<std::vector<int>> neighbours(map.keyframes.size());
  for (const CovisibilityEdge& edge : covisibility_edges(map, map.keyframe(from).session, kLeastShared)) {
    neighbours[static_cast<std::size_t>(edge.from)].push_back(edge.to);
    neighbours[static_cast<std::size_t>(edge.to)].push_back(edge.from);
  }
  std::vector<double> path(map.keyframes.size(), std::numeric_limits<double>::infinity());
  using Entry = std::pair<double, int>;
  std::priority_queue<Entry, std::vector<Entry>, std::greater<>> open;
  open.emplace(path[static_cast<std::size_t>(from)] = 0.0, from);
  while (!open.empty()) {
    const auto [length, here] = open.top();
    open.pop();
    if (here == to) return length;
    if (length > path[static_cast<std::size_t>(here)]) continue;
    for (int next : neighbours[static_cast<std::size_t>(here)]) {
      const double longer = length + (map.keyframe(here).view.centre() - map.keyframe(next).view.centre()).norm();
      if (longer < path[static_cast<std::size_t>(next)])
        open.emplace(path[static_cast<std::size_t>(next)] = longer, next);
    }
  }
  return std::numeric_limits<double>::infinity();
}

View correction_of(const LandmarkMap& map, const FoundLoop& loop) {
  return loop.view.inverse() * map.keyframe(loop.newest).view;
}

VisualLoopDetector::VisualLoopDetector(const matching::BinaryVocabulary& vocabulary, const ClientOptions& options)
    : vocabulary_(vocabulary), options_(options), index_(vocabulary.words()) {}

void VisualLoopDetector::add(const LandmarkMap& map, int keyframe) {
  index_.add(id_of(keyframe), vocabulary_.describe_picture(map.keyframe(keyframe).features.descriptors).bag);
}
void VisualLoopDetector::remove(int keyframe) { index_.remove(id_of(keyframe)); }

std::vector<int> VisualLoopDetector::alike(const matching::OrbFeatures& features, std::size_t most) const {
  std::vector<int> result;
  for (const matching::SimilarPlace& place : index_.query(vocabulary_.describe_picture(features.descriptors).bag, most))
    result.push_back(static_cast<int>(place.id.index));
  return result;
}

std::optional<FoundLoop> VisualLoopDetector::look(LandmarkMap& map, int newest, const Pyramid& picture,
                                                  const Motion& motion) {
  if (!options_.loops.enabled) return std::nullopt;
  const Keyframe& keyframe = map.keyframe(newest);
  const std::uint32_t now = keyframe.serial;
  while (!claims_.empty() && claims_.front().serial + kRemembered < now) claims_.pop_front();
  std::vector<char> near(map.keyframes.size(), 0);
  for (const CovisibleKeyframe& shared : covisible(map, newest)) near[static_cast<std::size_t>(shared.keyframe)] = 1;
  const auto is_no_loop = [&](const NodeId& id) {
    const Keyframe& other = map.keyframe(static_cast<int>(id.index));
    return near[id.index] != 0 || (other.session == keyframe.session && other.serial + kLatest > now);
  };
  const auto bag = vocabulary_.describe_picture(keyframe.features.descriptors).bag;
  // As alike as a share of what the keyframe before is.
  const int least_score = static_cast<int>(kLeastAlike * matching::common_share(bag, last_bag_));
  last_bag_ = bag;
  const auto groups = matching::best_of_groups(
      index_.query(bag, kLookedUp, is_no_loop, std::max(1, least_score)), [&](const NodeId& id) {
        std::vector<NodeId> result;
        for (const CovisibleKeyframe& shared : covisible(map, static_cast<int>(id.index)))
          result.push_back(id_of(shared.keyframe));
        return result;
      });
  for (std::size_t i = 0; i < groups.size() && i < kJudged; ++i) {
    auto loop = compare(map, newest, static_cast<int>(groups[i].id.index), picture, motion);
    if (!loop) continue;
    const Claim claim{now,
                      keyframe.session,
                      map.keyframe(loop->earlier).session,
                      correction_of(map, *loop),
                      keyframe.view.centre(),
                      loop->scale};
    claims_.push_back(claim);
    const Departure off = departure_of(map, *loop);
    const Allowed answer = allowed(off, repeats_m_);
    const Agreement lately = agreement_with(claim, now - std::min(now, kMemory));
    const bool is_sure = lately.agree >= options_.loops.agreeing_keyframes;
    if (claim.session == claim.earlier_session) {
      const double moved_m = (claim.correction * claim.centre - claim.centre).norm();
      if (is_sure && answer == Allowed::no && moved_m > 2.0 * off.reach_m) repeats_m_ = std::min(repeats_m_, moved_m);
      if (answer != Allowed::yes) continue;
      if (!is_sure) return std::nullopt;
    } else {
      const Agreement all = agreement_with(claim, 0);
      repeats_m_ = std::min(repeats_m_, all.rival_m);
      const bool is_unique = std::isinf(repeats_m_) && all.extent_m >= 2.0 * options_.session.alike_m;
      if (!is_sure || !(answer == Allowed::yes || is_unique)) continue;
    }
    claims_.clear();
    return loop;
  }
  return std::nullopt;
}

VisualLoopDetector::Agreement VisualLoopDetector::agreement_with(const Claim& claim, std::uint32_t serial) const {
  Agreement result;
  std::vector<double> rivals_m;
  std::optional<std::uint32_t> last;  // a keyframe speaks once
  for (const Claim& other : claims_) {
    if (other.serial < serial || other.session != claim.session || other.earlier_session != claim.earlier_session)
      continue;
    const double apart_m = (other.corrected(claim.centre) - claim.corrected(claim.centre)).norm();
    const double between_m = (other.centre - claim.centre).norm();
    if (apart_m < options_.loops.drift_m + options_.loops.drift * between_m &&
        angle_of(other.correction * claim.correction.inverse()) < kTurnApart &&
        std::abs(std::log(other.scale / claim.scale)) < kScaleApart) {
      result.agree += last != other.serial;
      last = other.serial;
      result.extent_m = std::max(result.extent_m, between_m);
    } else if (apart_m > kApart_m) {
      rivals_m.push_back(apart_m);
    }
  }
  std::sort(rivals_m.begin(), rivals_m.end());
  const auto several = static_cast<std::size_t>(options_.loops.agreeing_keyframes);
  if (rivals_m.size() >= several) result.rival_m = rivals_m.front();
  return result;
}

std::optional<FoundLoop> VisualLoopDetector::compare(LandmarkMap& map, int newest, int earlier, const Pyramid& picture,
                                                     const Motion& motion) {
  std::vector<int> among = with_covisible(map, earlier, kCovisible), here = with_covisible(map, newest, 2);
  const auto earlier_from_newest = first_from_second(place_of(map, among).view, place_of(map, here).view,
                                                     options_.loops.least_probability, options_.seed);
  if (!earlier_from_newest) return std::nullopt;
  const Pose3 map_from_earlier = pose_of(map.keyframe(earlier).view);
  FoundLoop loop;
  loop.newest = newest;
  loop.earlier = earlier;
  loop.view = view_of(compose(map_from_earlier, earlier_from_newest->pose));
  loop.scale = map.monocular ? earlier_from_newest->scale : 1.0;
  std::vector<Match> found = finder_.find(map, among, picture, loop.view, motion, options_.tracking);
  const auto is_weak = [&](const Match& match) {
    return map.landmark(match.landmark).borrowed.has_value() || !is_known(map.landmark(match.landmark));
  };
  found.erase(std::remove_if(found.begin(), found.end(), is_weak), found.end());
  std::vector<Sighting> sightings;
  for (const Match& match : found) sightings.push_back(map.sighting_of(match, options_.tracking.sigma_px));
  const PoseFromPoints pose =
      pose_from_points(sightings, map.camera, loop.view, map.calibration, options_.tracking.gate_sigmas);
  if (pose.count < options_.tracking.least_landmarks || 2 * pose.count < static_cast<int>(found.size()))
    return std::nullopt;
  loop.view = pose.view;
  loop.serial = map.keyframe(newest).serial;
  for (std::size_t i = 0; i < found.size(); ++i)
    if (pose.fits[i]) {
      loop.matches.push_back(found[i]);
      loop.serials.push_back(map.landmark(found[i].landmark).serial);
    }
  return loop;
}

Departure VisualLoopDetector::departure_of(const LandmarkMap& map, const FoundLoop& loop) const {
  const int here = map.keyframe(loop.newest).session, there = map.keyframe(loop.earlier).session;
  const double drift = options_.loops.drift;
  if (here == there) {
    const View correction = correction_of(map, loop);
    const Eigen::Vector3d centre = map.keyframe(loop.newest).view.centre();
    const double path = path_between(map, loop.newest, loop.earlier);
    // A single camera that turns where it stands sees nothing new under two angles, and goes on at another scale. The
    // loop shows which, and how far the path since then may have drifted.
    const double stretch = std::abs(std::log(loop.scale)), reach_m = options_.loops.drift_m + (drift + stretch) * path;
    const bool as_expected = stretch < kStretch && angle_of(correction) < kTurn + kTurnPerMetre * path;
    return {as_expected ? (correction * centre - centre).norm() : std::numeric_limits<double>::infinity(), reach_m};
  }
  const auto [left, begun] = nearest_in_time(map, there, here);
  const Keyframe &last = map.keyframe(left), &first = map.keyframe(begun);
  const View first_as_claimed =
      stretched(first.view * map.keyframe(loop.newest).view.inverse(), loop.scale) * loop.view;
  Departure off =
      departure({last.stamp, last.driven, last.view}, {first.stamp, first.driven, first_as_claimed}, options_.session);
  off.reach_m += drift * (path_between(map, left, loop.earlier) + path_between(map, begun, loop.newest));
  return off;
}

}  // namespace mapweave::visual
