#include "follower.h"

#include "frame_alignment.h"

#include <algorithm>
#include <cmath>

namespace mapweave::visual {
namespace {

constexpr int kCoarsest = 4, kFinest = 2;  // levels of the first alignment
constexpr std::size_t kPlaces = 12;        // that a picture is compared with, of those that look most alike

}  // namespace

Attempt Follower::locate(const Pyramid& picture, int among, const View& start, const Motion& speed, double wider) {
  Attempt attempt;
  attempt.motion = speed, attempt.session = among;
  const std::vector<Match> none;
  const auto near =
      near_keyframes(map, among, among == session ? matches : none, start, options.tracking.near_keyframes);
  TrackingOptions looking = options.tracking;
  looking.reach_px *= wider;
  if (among == session && !matches.empty()) looking.cell_px = cell_of_scene(matches.size(), map.camera, looking);
  attempt.found = finder.find(map, near, picture, start, speed, looking);
  attempt.pose = pose_by(map, among, attempt.found, start, options.tracking);
  return attempt;
}

bool Follower::is_good(const Attempt& attempt, bool followed) const {
  return visual::is_good(map, attempt, followed, options.tracking);
}

Attempt Follower::follow_features(const Pyramid& picture, double interval_s) {
  constexpr double kFar = 5.0;  // times the usual reach; a second search starts from what it finds
  const Attempt far = locate(picture, session, motion * view, Motion(), kFar);
  if (!is_good(far, true)) return far;
  return locate(picture, session, far.pose.view, motion_of(far.pose.view * view.inverse(), interval_s));
}

View Follower::expected_motion(const Frame& frame) const {
  if (!frame.expected || lost_s > 0.0) return motion;
  const Eigen::Matrix3d later_from_earlier = frame.expected->earlier_from_later.conjugate().toRotationMatrix();
  if (!frame.expected->translation) return {later_from_earlier, motion.translation};
  return {later_from_earlier, -(later_from_earlier * *frame.expected->translation)};
}

Attempt Follower::follow(const Frame& frame, const Pyramid& picture, double interval_s) {
  if (picture.features) return follow_features(picture, interval_s);
  std::vector<Eigen::Vector2d> pixels;
  std::vector<Eigen::Vector3d> points;
  for (const Match& match : matches) {
    const Eigen::Vector3d p = view * map.landmark(match.landmark).point;
    if (p.z() < 0.1) continue;
    pixels.push_back(map.camera.project(p)), points.push_back(p);
  }
  const View moved_by =
      align_frames(last, pixels, points, picture, map.camera, expected_motion(frame), kCoarsest, kFinest).to_from_from;
  return locate(picture, session, moved_by * view, motion_of(moved_by, interval_s));
}

Departure Follower::departure_to(const View& found, int among, Stamp now) const {
  const Station here{now, driven, found};
  if (among == session) return departure({last_stamp, last_driven, view}, here, options.session);
  const Keyframe& left = map.keyframe(newest_of(map, among));
  return departure({left.stamp, left.driven, left.view}, here, options.session);
}

Attempt Follower::find_again(const Pyramid& picture, Stamp now, Attempt best) {
  const double interval_s = seconds_between(last_stamp, now), repeats_m = closer ? closer->repeats_m() : kUnique_m;
  const matching::OrbFeatures features =
      picture.features ? picture.features->features() : features_of(picture, options.tracking.features);
  const auto try_near = [&](const std::vector<int>& keyframes) {
    const int among = map.keyframe(keyframes.front()).session;
    const auto found = find_place(map, keyframes, features, options.seed);
    if (!found) return Attempt();
    const Departure off = departure_to(*found, among, now);
    const Allowed answer = allowed(off, repeats_m);
    if (answer == Allowed::unclear || (answer == Allowed::no && !std::isfinite(off.error_m))) return Attempt();
    const Motion speed = among == session ? motion_of(*found * view.inverse(), interval_s) : Motion();
    Attempt attempt = locate(picture, among, *found, speed);
    if (answer == Allowed::yes) return attempt;
    if (is_good(attempt)) driven.refused_m = std::min(driven.refused_m, off.error_m);
    return Attempt();
  };
  if (is_good(best) && allowed(departure_to(best.pose.view, session, now), repeats_m) != Allowed::yes) best = Attempt();
  std::vector<int> around = near_keyframes(map, session, matches, view, 4);
  if (std::find(around.begin(), around.end(), reference) == around.end()) around.insert(around.begin(), reference);
  std::optional<Attempt> answer;
  if (Attempt attempt = try_near(around); attempt.pose.count > best.pose.count) {
    if (is_good(attempt)) answer = attempt;
    best = std::move(attempt);
  }
  if (!closer || (is_good(best) && interval_s < kCarried_s)) return best;
  best = Attempt();
  for (int number : closer->alike(features, kPlaces)) {
    Attempt attempt = try_near({number});
    if (!is_good(attempt)) continue;
    if (!answer) {
      answer = std::move(attempt);
    } else if (attempt.session == answer->session) {
      // Two answers farther apart are two places that look alike.
      constexpr double kApart_m = 0.5, kApart_rad = 0.3;
      const View apart = attempt.pose.view * answer->pose.view.inverse();
      if (apart.centre().norm() > kApart_m || Eigen::AngleAxisd(apart.rotation).angle() > kApart_rad) return best;
      if (attempt.pose.count > answer->pose.count) answer = std::move(attempt);
    }
  }
  return answer ? *answer : best;
}

}  // namespace mapweave::visual
