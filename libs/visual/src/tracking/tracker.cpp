#include "tracker.h"

#include "frame_alignment.h"
#include "pictures/feature_grid.h"

#include <mapweave/core/median.h>

#include <algorithm>
#include <cmath>

namespace mapweave::visual {
namespace {

constexpr double kCarried_s = 0.5;   // in so long a camera may have come anywhere
constexpr std::size_t kPlaces = 12;  // that a picture is compared with, of those that look most alike

}  // namespace

Attempt Tracker::locate(LandmarkMap& map, const Pyramid& picture, int among, const View& start, const Motion& speed,
                        double wider) {
  Attempt attempt;
  attempt.motion = speed;
  attempt.session = among;
  const std::vector<Match> none;
  const auto near = near_keyframes(map, among, among == place_.session ? place_.matches : none, start,
                                   options_.tracking.near_keyframes);
  TrackingOptions looking = options_.tracking;
  looking.reach_px *= wider;
  if (among == place_.session && !place_.matches.empty())
    looking.cell_px = cell_of_scene(place_.matches.size(), map.camera, looking);
  attempt.found = finder_.find(map, near, picture, start, speed, looking);
  attempt.pose = pose_by(map, among, attempt.found, start, options_.tracking);
  return attempt;
}

bool Tracker::is_good(const LandmarkMap& map, const Attempt& attempt) const {
  return visual::is_good(map, attempt, false, options_.tracking);
}

Attempt Tracker::follow_features(LandmarkMap& map, const Pyramid& picture, double interval_s) {
  constexpr double kFar = 5.0;  // times the usual reach; a second search starts from what it finds
  const Attempt far = locate(map, picture, place_.session, motion_ * place_.view, Motion(), kFar);
  if (!visual::is_good(map, far, true, options_.tracking)) return far;
  return locate(map, picture, place_.session, far.pose.view,
                motion_of(far.pose.view * place_.view.inverse(), interval_s));
}

View Tracker::expected_motion(const Frame& frame) const {
  if (!frame.expected || lost_s_ > 0.0) return motion_;
  const Eigen::Matrix3d later_from_earlier = frame.expected->earlier_from_later.conjugate().toRotationMatrix();
  if (!frame.expected->translation) return {later_from_earlier, motion_.translation};
  return {later_from_earlier, -(later_from_earlier * *frame.expected->translation)};
}

Attempt Tracker::follow(LandmarkMap& map, const Frame& frame, const Pyramid& picture) {
  const double interval_s = seconds_between(last_stamp_, frame.stamp);
  if (picture.features) return follow_features(map, picture, interval_s);
  ShownPoints shown;
  for (const Match& match : place_.matches) {
    const Eigen::Vector3d p = place_.view * map.landmark(match.landmark).point;
    if (p.z() < kNearest_m) continue;
    shown.pixels.push_back(map.camera.project(p));
    shown.points.push_back(p);
  }
  const View moved_by = align_frames(last_, shown, picture, map.camera, expected_motion(frame)).to_from_from;
  return locate(map, picture, place_.session, moved_by * place_.view, motion_of(moved_by, interval_s));
}

Departure Tracker::departure_to(const LandmarkMap& map, const View& found, int among, Stamp now) const {
  const Station here{now, driven_, found};
  if (among == place_.session) return departure({last_stamp_, last_driven_, place_.view}, here, options_.session);
  const Keyframe& left = map.keyframe(newest_of(map, among));
  return departure({left.stamp, left.driven, left.view}, here, options_.session);
}

Attempt Tracker::find_again(LandmarkMap& map, const VisualLoopDetector* places, const Pyramid& picture, Stamp now,
                            Attempt best) {
  const double interval_s = seconds_between(last_stamp_, now);
  const double repeats_m = places != nullptr ? places->repeats_m() : kUnique_m;
  const matching::OrbFeatures features =
      picture.features ? picture.features->features() : features_of(picture, options_.tracking.features);
  const auto try_near = [&](const std::vector<int>& keyframes) {
    const int among = map.keyframe(keyframes.front()).session;
    const auto found = find_place(map, keyframes, features, options_.seed);
    if (!found) return Attempt();
    const Departure off = departure_to(map, *found, among, now);
    const Allowed answer = allowed(off, repeats_m);
    if (answer == Allowed::unclear || (answer == Allowed::no && !std::isfinite(off.error_m))) return Attempt();
    const Motion speed = among == place_.session ? motion_of(*found * place_.view.inverse(), interval_s) : Motion();
    Attempt attempt = locate(map, picture, among, *found, speed);
    if (answer == Allowed::yes) return attempt;
    if (is_good(map, attempt)) driven_.refused_m = std::min(driven_.refused_m, off.error_m);
    return Attempt();
  };
  if (is_good(map, best) && allowed(departure_to(map, best.pose.view, place_.session, now), repeats_m) != Allowed::yes)
    best = Attempt();
  std::vector<int> around = near_keyframes(map, place_.session, place_.matches, place_.view, 4);
  if (std::find(around.begin(), around.end(), place_.reference) == around.end())
    around.insert(around.begin(), place_.reference);
  std::optional<Attempt> answer;
  if (Attempt attempt = try_near(around); attempt.pose.count > best.pose.count) {
    if (is_good(map, attempt)) answer = attempt;
    best = std::move(attempt);
  }
  if (places == nullptr || (is_good(map, best) && interval_s < kCarried_s)) return best;
  best = Attempt();
  for (int number : places->alike(features, kPlaces)) {
    Attempt attempt = try_near({number});
    if (!is_good(map, attempt)) continue;
    if (!answer) {
      answer = std::move(attempt);
    } else if (attempt.session == answer->session) {
      // Places so far apart that both fit look alike: neither is believed.
      constexpr double kApart_m = 0.5, kApart_rad = 0.3;
      const View apart = attempt.pose.view * answer->pose.view.inverse();
      if (apart.centre().norm() > kApart_m || Eigen::AngleAxisd(apart.rotation).angle() > kApart_rad) return best;
      if (attempt.pose.count > answer->pose.count) answer = std::move(attempt);
    }
  }
  return answer ? *answer : best;
}

bool Tracker::is_followed(const LandmarkMap& map, const Attempt& attempt, Stamp now) const {
  const bool just_now =
      lost_stamp_ == last_stamp_ || (lost_s_ == 0.0 && seconds_between(last_stamp_, now) < kCarried_s);
  return just_now && visual::is_good(map, attempt, true, options_.tracking);
}

std::optional<Station> Tracker::astray_since(const LandmarkMap& map, const Attempt& attempt, Stamp now) const {
  if (recent_.is_empty()) return std::nullopt;
  if (!recent_.contradict(attempt, {now, driven_, attempt.pose.view}, options_.session) &&
      !is_led_by_a_thing(map, attempt, options_.tracking))
    return std::nullopt;
  return recent_.oldest();
}

void Tracker::go_back(const LandmarkMap& map, const Station& there) {
  recent_.clear();
  place_.reference = newest_of(map, place_.session);
  place_.view = there.view;
  motion_ = View();
  last_stamp_ = there.stamp;
  last_driven_ = there.driven;
  drop_what_is_gone(map);
}

void Tracker::take(LandmarkMap& map, const Attempt& attempt, bool is_followed) {
  place_.matches.clear();
  dynamic_outliers_.clear();
  for (std::size_t i = 0; i < attempt.found.size(); ++i) {
    const Match& match = attempt.found[i];
    ClientLandmark& landmark = map.landmark(match.landmark);
    if (attempt.pose.fits[i]) {
      place_.matches.push_back(match);
      ++landmark.found;
    } else if (!landmark.borrowed) {
      dynamic_outliers_.push_back(match.pixel);
    }
  }
  const bool is_elsewhere = attempt.session != place_.session;
  if (is_elsewhere || !is_followed) recent_.clear();
  motion_ = is_elsewhere ? View() : attempt.pose.view * place_.view.inverse();
  if (is_elsewhere) {
    place_.session = attempt.session;
    place_.reference = most_seen(map, place_.matches);
    place_.reference_landmarks = place_.matches.size();
  }
  place_.view = attempt.pose.view;
}

void Tracker::add_matches(const std::vector<Match>& found) {
  place_.matches.insert(place_.matches.end(), found.begin(), found.end());
}

bool Tracker::is_keyframe_due(const LandmarkMap& map) const {
  const View since = place_.view * map.keyframe(place_.reference).view.inverse();
  std::vector<double> depths;
  for (const Match& match : place_.matches) depths.push_back((place_.view * map.landmark(match.landmark).point).z());
  const double middle_m = depths.empty() ? 1.0 : median(std::move(depths));
  return static_cast<double>(place_.matches.size()) <
             options_.keyframe.kept_share * static_cast<double>(place_.reference_landmarks) ||
         Eigen::AngleAxisd(since.rotation).angle() > options_.keyframe.turn_rad ||
         since.centre().norm() > options_.keyframe.parallax * middle_m;
}

void Tracker::finish_tracked(Stamp stamp, Pyramid picture, double share) {
  last_ = std::move(picture);
  recent_.add({stamp, driven_, place_.view}, share);
  arrive(stamp);
}

void Tracker::finish_lost(Stamp stamp, bool shows_something) {
  motion_ = View();
  if (shows_something) lost_s_ += std::max(1e-3, seconds_between(lost_stamp_, stamp));
  lost_stamp_ = stamp;
}

void Tracker::begin_at(TrackedPlace place, Stamp stamp, Pyramid picture) {
  place_ = std::move(place);
  motion_ = View();
  last_ = std::move(picture);
  arrive(stamp);
}

void Tracker::arrive(Stamp stamp) {
  driven_.refused_m = std::numeric_limits<double>::infinity();
  last_stamp_ = lost_stamp_ = stamp;
  last_driven_ = driven_;
  lost_s_ = 0.0;
}

void Tracker::drop_what_is_gone(const LandmarkMap& map) {
  auto& matches = place_.matches;
  matches.erase(std::remove_if(matches.begin(), matches.end(),
                               [&](const Match& match) { return map.landmark(match.landmark).gone; }),
                matches.end());
}

void Tracker::carry(const LandmarkMap& map, const std::function<std::vector<double>()>& move) {
  const View view_from_reference = place_.view * map.keyframe(place_.reference).view.inverse();
  const double scale = move()[static_cast<std::size_t>(place_.reference)];
  recent_.clear();
  place_.view = stretched(view_from_reference, scale) * map.keyframe(place_.reference).view;
  motion_ = stretched(motion_, scale);
}

}  // namespace mapweave::visual
