#include "map_correction.h"

#include "geometry/bundle_sighting.h"

#include <mapweave/graph/spatial_graph.h>

#include <algorithm>
#include <cmath>
#include <map>

namespace mapweave::visual {
namespace {

constexpr int kSharedInGraph = 30;  // shared landmarks of an edge of the essential graph
constexpr double kHeld = 1e6;       // landmarks that would hold a keyframe of others where it is
constexpr double kWeakEdge = 10.0;  // landmarks that neighbours in time count as at least
// A turn by this much moves what is seen as much as a step of a metre does.
constexpr double kTurnPerMetre = 0.3;

bool sees(const ClientLandmark& landmark, int keyframe) {
  return std::any_of(landmark.seen.begin(), landmark.seen.end(),
                     [&](const Observation& o) { return o.keyframe == keyframe; });
}

}  // namespace

MapCorrection::MapCorrection(const LandmarkMap& map, FoundLoop loop, double sigma_px) : loop_(std::move(loop)) {
  const int session = map.keyframe(loop_.newest).session;
  std::vector<int> view_of_keyframe(map.keyframes.size(), -1);
  const int first = first_of(map, session);
  for (int number = 0; number < static_cast<int>(map.keyframes.size()); ++number) {
    const Keyframe& keyframe = map.keyframe(number);
    if (keyframe.gone || keyframe.session != session) continue;
    view_of_keyframe[static_cast<std::size_t>(number)] = static_cast<int>(keyframes_.size());
    keyframes_.push_back({number, keyframe.serial});
    bundle_.views.push_back({keyframe.view, 0, number == first});
  }
  const auto view_number = [&](int keyframe) { return view_of_keyframe[static_cast<std::size_t>(keyframe)]; };
  newest_ = static_cast<std::size_t>(view_number(loop_.newest));
  earlier_ = loop_.fixed ? bundle_.views.size() : static_cast<std::size_t>(view_number(loop_.earlier));
  for (const CovisibilityEdge& edge : covisibility_edges(map, session, kSharedInGraph))
    covisibility_edges_.push_back({view_number(edge.from), view_number(edge.to), edge.landmarks});
  std::vector<const Match*> in_loop(map.landmarks.size(), nullptr);
  for (const Match& match : loop_.matches) in_loop[static_cast<std::size_t>(match.landmark)] = &match;
  for (int id = 0; id < static_cast<int>(map.landmarks.size()); ++id) {
    const ClientLandmark& landmark = map.landmark(id);
    if (landmark.gone || landmark.borrowed || landmark.seen.empty() || view_number(landmark.seen.front().keyframe) < 0)
      continue;
    const std::size_t point = landmarks_.size();
    landmarks_.push_back({id, landmark.serial});
    bundle_.points.push_back(landmark.point);
    anchors_.push_back(view_number(landmark.seen.front().keyframe));
    for (const Observation& o : landmark.seen)
      bundle_.sightings.push_back(bundle_sighting(view_number(o.keyframe), point, o.sighting));
    const Match* match = in_loop[static_cast<std::size_t>(id)];
    if (match != nullptr && !sees(landmark, loop_.newest))
      bundle_.sightings.push_back(bundle_sighting(static_cast<int>(newest_), point, map.sighting_of(*match, sigma_px)));
  }
  if (loop_.fixed) add_fixed(loop_.fixed->sightings);
  bundle_.cameras.push_back(map.camera);
  bundle_.calibration = map.calibration;
  monocular_ = map.monocular;
  stretches_ = stretches_of(map);
  scales_.assign(bundle_.views.size() + (loop_.fixed ? 1 : 0), 1.0);
}

void MapCorrection::add_fixed(const std::vector<Sighting>& sightings) {
  bundle_.fixed_points.assign(bundle_.points.size(), 0);
  for (const Sighting& sighting : sightings) {
    bundle_.sightings.push_back(bundle_sighting(static_cast<int>(newest_), bundle_.points.size(), sighting));
    bundle_.points.push_back(sighting.point_in_map);
    bundle_.fixed_points.push_back(1);
  }
}

// A single camera that turns where it stands goes on at another scale. Wheels show where that was: by keyframe, the
// logarithm of what its scale must grow by, as the three metres around it say that lie on the same side of such
// places; all 0 where there is none, for wheels slip.
std::vector<double> MapCorrection::stretches_of(const LandmarkMap& map) const {
  std::vector<double> stretches(keyframes_.size(), 0.0);
  if (!map.monocular) return stretches;
  std::vector<std::size_t> order(keyframes_.size());
  for (std::size_t i = 0; i < order.size(); ++i) order[i] = i;
  std::sort(order.begin(), order.end(),
            [&](std::size_t a, std::size_t b) { return keyframes_[a].serial < keyframes_[b].serial; });
  std::vector<double> driven_m(order.size(), 0.0),
      mapped_m(order.size(), 0.0);  // from the first to each, where both are known
  for (std::size_t i = 1; i < order.size(); ++i) {
    const Keyframe &last = map.keyframe(keyframes_[order[i - 1]].slot), &here = map.keyframe(keyframes_[order[i]].slot);
    driven_m[i] = driven_m[i - 1];
    mapped_m[i] = mapped_m[i - 1];
    if (!last.driven.odometry_from_camera || !here.driven.odometry_from_camera) continue;
    const double step_m = between(*last.driven.odometry_from_camera, *here.driven.odometry_from_camera).t.norm();
    constexpr double kLeast_m = 0.02;  // less is noise
    if (step_m > kLeast_m) {
      driven_m[i] += step_m;
      mapped_m[i] += (here.view.centre() - last.view.centre()).norm();
    }
  }
  const auto stretch_between = [&](std::size_t from, std::size_t to) {
    return std::log((driven_m[to] - driven_m[from]) / std::max(1e-9, mapped_m[to] - mapped_m[from]));
  };
  // Path on either side; logarithm that slip explains; path that is averaged.
  constexpr double kDriven_m = 1.0, kSlip = 0.15, kSmooth_m = 3.0;
  struct Change {
    double size;
    std::size_t at;
  };
  std::vector<Change> changes;
  for (std::size_t i = 0; i < order.size(); ++i) {
    const auto before = std::upper_bound(driven_m.begin(), driven_m.end(), driven_m[i] - kDriven_m),
               after = std::lower_bound(driven_m.begin(), driven_m.end(), driven_m[i] + kDriven_m);
    if (before == driven_m.begin() || after == driven_m.end()) continue;
    const auto from = static_cast<std::size_t>(before - driven_m.begin()) - 1,
               to = static_cast<std::size_t>(after - driven_m.begin());
    const double size = std::abs(stretch_between(i, to) - stretch_between(from, i));
    if (size > kSlip) changes.push_back({size, i});
  }
  std::stable_sort(changes.begin(), changes.end(), [](const Change& a, const Change& b) { return a.size > b.size; });
  std::vector<std::size_t> breaks;  // first keyframes of stretches of their own
  for (const Change& change : changes)
    if (std::none_of(breaks.begin(), breaks.end(),
                     [&](std::size_t at) { return std::abs(driven_m[at] - driven_m[change.at]) < kDriven_m; }))
      breaks.push_back(change.at);
  if (breaks.empty()) return stretches;
  breaks.push_back(0);
  breaks.push_back(order.size());
  std::sort(breaks.begin(), breaks.end());
  for (std::size_t k = 0; k + 1 < breaks.size(); ++k) {
    const std::size_t first = breaks[k], last = std::min(breaks[k + 1], order.size() - 1);
    for (std::size_t i = first; i < breaks[k + 1]; ++i) {
      std::size_t from = i, to = i;
      while (from > first && driven_m[i] - driven_m[from] < kSmooth_m) --from;
      while (to < last && driven_m[to] - driven_m[i] < kSmooth_m) ++to;
      if (driven_m[to] > driven_m[from]) stretches[order[i]] = stretch_between(from, to);
    }
  }
  return stretches;
}

void MapCorrection::run() {
  std::vector<Pose3> poses;
  std::uint32_t fixed = 0;
  for (std::size_t i = 0; i < bundle_.views.size(); ++i) {
    poses.push_back(pose_of(bundle_.views[i].view));
    if (bundle_.views[i].fixed) fixed = static_cast<std::uint32_t>(i);
  }
  std::vector<graph::SpatialEdge> edges;
  std::vector<graph::SimilarityEdge> drifting;
  const auto add_edge = [&](std::size_t from, std::size_t to, const Sim3& from_from_to, double landmarks) {
    const auto a = static_cast<std::uint32_t>(from), b = static_cast<std::uint32_t>(to);
    graph::SimilarityEdge edge{a, b, from_from_to, landmarks * Eigen::Matrix<double, 7, 7>::Identity()};
    edge.information.block<3, 3>(3, 3) /= kTurnPerMetre * kTurnPerMetre;
    if (monocular_)
      drifting.push_back(edge);
    else
      edges.push_back({a, b, from_from_to.pose, edge.information.topLeftCorner<6, 6>()});
  };
  for (const CovisibilityEdge& known : covisibility_edges_) {
    const auto from = static_cast<std::size_t>(known.from), to = static_cast<std::size_t>(known.to);
    add_edge(from, to, {between(poses[from], poses[to]), std::exp(stretches_[to] - stretches_[from])},
             std::max(kWeakEdge, static_cast<double>(known.landmarks)));
  }
  if (loop_.fixed) {
    poses.push_back(pose_of(loop_.fixed->view));
    add_edge(fixed, earlier_, {between(poses[fixed], poses[earlier_]), 1.0}, kHeld);
  }
  add_edge(earlier_, newest_, {between(poses[earlier_], pose_of(loop_.view)), loop_.scale},
           10.0 * static_cast<double>(loop_.matches.size()));
  constexpr int kIterations = 50;  // as graph::solve() has unless asked otherwise
  if (monocular_) {
    std::vector<Sim3> similar;
    for (const Pose3& pose : poses) similar.push_back({pose, 1.0});
    const graph::SimilaritySolution solution = graph::solve(similar, drifting, kIterations, fixed);
    for (std::size_t i = 0; i < poses.size(); ++i) {
      poses[i] = solution.poses[i].pose;
      scales_[i] = solution.poses[i].scale;
    }
  } else {
    poses = graph::solve(poses, edges, kIterations, fixed).poses;
  }

  const std::vector<graph::BundleView> before = bundle_.views;
  for (std::size_t i = 0; i < before.size(); ++i) bundle_.views[i].view = view_of(poses[i]);
  for (graph::BundleSighting& seen : bundle_.sightings) {
    seen.inverse_depth /= scales_[seen.view];
    seen.inverse_depth_sigma /= scales_[seen.view];
  }
  for (std::size_t i = 0; i < landmarks_.size(); ++i) {
    const auto anchor = static_cast<std::size_t>(anchors_[i]);
    bundle_.points[i] =
        bundle_.views[anchor].view.inverse() * (scales_[anchor] * (before[anchor].view * bundle_.points[i]));
  }
  constexpr int kSteps = 8;
  graph::adjust(bundle_, bundle_options(kSteps));
}

std::vector<double> MapCorrection::apply(LandmarkMap& map) const {
  std::vector<KeyframeMotion> motions;
  for (std::size_t i = 0; i < keyframes_.size(); ++i) {
    const Keyframe& keyframe = map.keyframe(keyframes_[i].slot);
    if (!keyframe.gone && keyframe.serial == keyframes_[i].serial)
      motions.push_back({keyframes_[i].slot, bundle_.views[i].view, scales_[i]});
  }
  auto scales = move_keyframes(map, map.keyframe(keyframes_.front().slot).session, motions);
  for (std::size_t i = 0; i < landmarks_.size(); ++i) {
    ClientLandmark& landmark = map.landmark(landmarks_[i].slot);
    if (!landmark.gone && landmark.serial == landmarks_[i].serial) landmark.point = bundle_.points[i];
  }
  return scales;
}

std::vector<KeyframeMotion> motions_to(const LandmarkMap& map, int session, const SessionId& own,
                                       const std::vector<MovedNode>& corrected, const Pose3& robot_from_camera,
                                       double scale) {
  std::map<std::uint32_t, const MovedNode*> known;
  for (const MovedNode& moved : corrected) {
    if (moved.id.session != own || !is_finite(moved.map_from_node) ||
        std::abs(moved.map_from_node.q.norm() - 1.0) > 1e-6)
      return {};
    known[moved.id.index] = &moved;
  }
  std::vector<KeyframeMotion> motions;
  for (int slot = 0; slot < static_cast<int>(map.keyframes.size()); ++slot) {
    const Keyframe& keyframe = map.keyframe(slot);
    const auto moved = known.find(keyframe.serial);
    if (keyframe.gone || keyframe.session != session || moved == known.end()) continue;
    const Pose3 camera = compose(compose(inverse(robot_from_camera), moved->second->map_from_node), robot_from_camera);
    motions.push_back({slot, view_of(camera), scale});
  }
  return motions;
}

std::vector<double> move_keyframes(LandmarkMap& map, int session, const std::vector<KeyframeMotion>& motions) {
  std::vector<View> before;
  for (const Keyframe& keyframe : map.keyframes) before.push_back(keyframe.view);
  std::vector<char> moved(map.keyframes.size(), 0);
  std::vector<double> scales(map.keyframes.size(), 1.0);
  for (const KeyframeMotion& motion : motions) {
    const auto slot = static_cast<std::size_t>(motion.keyframe);
    map.keyframes[slot].view = motion.view;
    moved[slot] = 1;
    scales[slot] = motion.scale;
  }
  const std::vector<int> order = keyframes_in_order(map, session, session);
  for (std::size_t i = 1; i < order.size(); ++i) {
    const auto here = static_cast<std::size_t>(order[i]), last = static_cast<std::size_t>(order[i - 1]);
    if (moved[here]) continue;
    scales[here] = scales[last];
    map.keyframes[here].view =
        stretched(before[here] * before[last].inverse(), scales[last]) * map.keyframes[last].view;
  }
  for (ClientLandmark& landmark : map.landmarks) {
    if (landmark.gone || landmark.borrowed || map.keyframe(landmark.seen.front().keyframe).session != session) continue;
    const auto anchor = static_cast<std::size_t>(landmark.seen.front().keyframe);
    landmark.point = map.keyframes[anchor].view.inverse() * (scales[anchor] * (before[anchor] * landmark.point));
  }
  if (map.monocular) stretch(map, scales);
  return scales;
}

void stretch(LandmarkMap& map, const std::vector<double>& scale_of_keyframe) {
  const auto scale_of = [&](int keyframe) { return scale_of_keyframe[static_cast<std::size_t>(keyframe)]; };
  for (std::size_t i = 0; i < map.keyframes.size(); ++i) {
    const auto scale = static_cast<float>(scale_of_keyframe[i]);
    for (float& depth : map.keyframes[i].depths) depth *= scale;
    for (AnchoredFrame& frame : map.keyframes[i].frames) frame.centre *= scale;
    for (ForgottenKeyframe& one : map.keyframes[i].forgotten) one.place.centre *= scale;
  }
  for (ClientLandmark& landmark : map.landmarks) {
    for (Observation& o : landmark.seen) {
      o.sighting.inverse_depth /= scale_of(o.keyframe);
      o.sighting.inverse_depth_sigma /= scale_of(o.keyframe);
    }
    for (Appearance& appearance : landmark.appearances)
      appearance.from_keyframe.translation *= scale_of(appearance.keyframe);
  }
  for (DepthCandidate& candidate : map.candidates) {
    candidate.inverse_depth /= scale_of(candidate.keyframe);
    candidate.sigma /= scale_of(candidate.keyframe);
  }
}

void see_matches(LandmarkMap& map, const FoundLoop& loop, double sigma_px) {
  const Keyframe& newest = map.keyframe(loop.newest);
  if (newest.gone || newest.serial != loop.serial) return;
  for (std::size_t i = 0; i < loop.matches.size(); ++i) {
    const Match& match = loop.matches[i];
    const ClientLandmark& landmark = map.landmark(match.landmark);
    if (!landmark.gone && landmark.serial == loop.serials[i] && !sees(landmark, loop.newest))
      map.see(match.landmark, {loop.newest, map.sighting_of(match, sigma_px)});
  }
}

void join_sessions(LandmarkMap& map, FoundLoop& loop) {
  const View newest = map.keyframe(loop.newest).view;
  const int here = map.keyframe(loop.newest).session, there = map.keyframe(loop.earlier).session;
  const int kept = std::min(here, there), moved = std::max(here, there);
  // One camera in both maps, and how its scale grows.
  const View from = moved == here ? newest : loop.view, to = moved == here ? loop.view : newest;
  const double scale = moved == here ? loop.scale : 1.0 / loop.scale;
  for (ClientLandmark& landmark : map.landmarks)
    if (!landmark.gone && !landmark.borrowed && map.keyframe(landmark.seen.front().keyframe).session == moved)
      landmark.point = to.inverse() * (scale * (from * landmark.point));
  std::vector<double> scales(map.keyframes.size(), 1.0);
  for (std::size_t i = 0; i < map.keyframes.size(); ++i) {
    Keyframe& keyframe = map.keyframes[i];
    if (keyframe.gone || keyframe.session != moved) continue;
    keyframe.view = stretched(keyframe.view * from.inverse(), scale) * to;
    keyframe.session = kept;
    scales[i] = scale;
  }
  if (map.monocular) stretch(map, scales);
  loop.view = to;
  loop.scale = 1.0;
}

}  // namespace mapweave::visual
