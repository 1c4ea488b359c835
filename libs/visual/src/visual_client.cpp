#include "input/sensor_notes.h"
#include "loops/map_correction.h"
#include "mapping/culling.h"
#include "mapping/keyframe_maker.h"
#include "mapping/local_window.h"
#include "mapping/map_report.h"
#include "mono/depth_candidates.h"
#include "mono/mono_start.h"
#include "pictures/detector.h"
#include "pictures/feature_grid.h"
#include "sharing/place_exchange.h"
#include "tracking/follower.h"
#include "tracking/recent_frames.h"

#include <mapweave/core/error.h>
#include <mapweave/visual/visual_client.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace mapweave::visual {
namespace {

constexpr int kNotedAfter = 10;          // frames
constexpr int kCulledAtOnce = 3;         // keyframes, of those that go because others show the same
constexpr double kBorrowedReach = 0.02;  // widths of the picture: how far landmarks of others are looked for

// The correction of a map after a loop, computed aside.
struct LoopCorrection {
  Stamp found, due;
  std::shared_ptr<MapCorrection> correction;
  std::shared_ptr<BackgroundWork> work;
};

}  // namespace

struct VisualClient::State : Follower {
  MonoStart mono_start;
  std::vector<std::string> notes;
  std::vector<Eigen::Vector2d> dynamic_outliers;  // landmarks that were found where they cannot be
  std::size_t reference_landmarks = 0;
  int sessions_begun = 0;
  std::size_t frames = 0;  // of the trajectory, at most
  int without_depth = 0;   // frames that could not begin a map, for all that they show
  bool noted_delay = false;
  Stamp lost_stamp;  // the last frame that was lost
  std::optional<LoopCorrection> loop_correction;
  std::optional<MapPublisher> publisher;
  BorrowedLandmarks borrowed;
  std::uint32_t forgotten = 0;  // times
  PlaceExchange exchange;
  std::vector<ReanchoredFrame> reanchored;
  std::optional<Stamp> begun;
  RecentFrames recent;
  std::vector<ClosedLoop> loops;

  // As if the frames since had shown nothing.
  void go_back(const Station& there) {
    recent.clear();
    remove_since(map, session, there.stamp, [&](int keyframe) {
      if (closer) closer->remove(keyframe);
    });
    reference = newest_of(map, session);
    view = there.view, motion = View(), last_stamp = there.stamp, last_driven = there.driven;
    drop_what_is_gone();
  }

  bool keyframe_is_due() const {
    const View since = view * map.keyframe(reference).view.inverse();
    std::vector<double> depths;
    for (const Match& match : matches) depths.push_back((view * map.landmark(match.landmark).point).z());
    const auto middle = depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
    std::nth_element(depths.begin(), middle, depths.end());
    return static_cast<double>(matches.size()) <
               options.keyframe.kept_share * static_cast<double>(reference_landmarks) ||
           Eigen::AngleAxisd(since.rotation).angle() > options.keyframe.turn_rad ||
           since.centre().norm() > options.keyframe.parallax * *middle;
  }

  void drop_what_is_gone() {
    matches.erase(std::remove_if(matches.begin(), matches.end(),
                                 [&](const Match& match) { return map.landmark(match.landmark).gone; }),
                  matches.end());
  }

  void make_keyframe(const Frame& frame, const Pyramid& picture, const Motion& speed) {
    reference = add_keyframe(map, {frame, picture, session, view, speed, driven}, dynamic_outliers, matches, options);
    look_for_borrowed(picture, speed);
    reference_landmarks = matches.size();
    adjust_window(map, reference, options.window);
    fuse_duplicates(
        map, near_keyframes(map, session, matches, map.keyframe(reference).view, options.tracking.near_keyframes),
        matches, picture, map.keyframe(reference).view);
    cull_landmarks(map, reference, options.memory);
    borrowed.tidy(map, session, map.keyframe(reference).view);
    drop_what_is_gone();
    cull_keyframes();
    look_for_loop(frame.stamp, picture, speed);
    view = map.keyframe(reference).view;
  }

  // Landmarks of others that the newest keyframe shows: frames follow them by how it does.
  void look_for_borrowed(const Pyramid& picture, const Motion& speed) {
    if (borrowed.size() == 0) return;
    const Keyframe& keyframe = map.keyframe(reference);
    const View here = keyframe.view;
    const double reach_px = std::max(8.0, kBorrowedReach * map.camera.width);
    auto found = picture.features
                     ? borrowed.look(map, {*picture.features, 0.0, session, here, speed}, matches, reach_px)
                     : borrowed.look(map, {grid_of(keyframe.features, map.camera), kFeature_px, session, here, speed},
                                     matches, reach_px);
    borrowed.keep(map, found, agreement(map, found, here, options.tracking).fits);
    for (const Match& match : found) see_borrowed(map, reference, picture, match, options.tracking.sigma_px);
    matches.insert(matches.end(), found.begin(), found.end());
  }

  void cull_keyframes() {
    for (int count = 0; count < kCulledAtOnce || map.keyframe_count() > options.memory.keyframes; ++count) {
      const int number = keyframe_to_cull(map, reference, options.memory);
      const int new_parent = number < 0 ? -1 : new_parent_of(map, number);
      if (new_parent < 0) break;
      if (closer) closer->remove(number);
      map.remove_keyframe(number, new_parent);
    }
    drop_what_is_gone();
  }

  void look_for_loop(Stamp stamp, const Pyramid& picture, const Motion& speed) {
    if (!closer) return;
    closer->add(map, reference);
    if (loop_correction) return;
    auto loop = closer->look(map, finder, reference, picture, speed);
    if (!loop) return;
    if (const int other = map.keyframe(loop->earlier).session; other != session) {
      for (int one : {session, other}) forget_borrowed(one);
      const auto moves = [&](const ReanchoredFrame& frame) { return frame.session == std::max(session, other); };
      reanchored.erase(std::remove_if(reanchored.begin(), reanchored.end(), moves), reanchored.end());
      map.reanchored.erase(std::remove(map.reanchored.begin(), map.reanchored.end(), std::max(session, other)),
                           map.reanchored.end());
      join_sessions(map, *loop);
      session = map.keyframe(reference).session;
    }
    const auto correction = std::make_shared<MapCorrection>(map, *loop, options.tracking.sigma_px);
    const auto delay = static_cast<std::int64_t>(options.loops.delay_s * 1e9);
    loop_correction = LoopCorrection{
        stamp, {stamp.ns + delay}, correction, std::make_shared<BackgroundWork>([correction] { correction->run(); })};
  }

  void forget_borrowed(int number) {
    if (borrowed.size() > 0) ++forgotten;
    borrowed.forget(map, number);
    drop_what_is_gone();
  }

  // As `move` does with the map: answers by how much the scale of each keyframe grows.
  template <class Move>
  void carry_view(const Move& move) {
    const View view_from_reference = view * map.keyframe(reference).view.inverse();
    const double scale = move()[static_cast<std::size_t>(reference)];
    recent.clear();
    view = stretched(view_from_reference, scale) * map.keyframe(reference).view, motion = stretched(motion, scale);
  }

  void apply_loop_correction(Stamp now) {
    loop_correction->work->run();
    forget_borrowed(session);  // its map changes under them
    carry_view([&] { return loop_correction->correction->apply(map); });
    see_matches(map, loop_correction->correction->loop(), options.tracking.sigma_px);
    loops.push_back({loop_correction->found, now});
    loop_correction.reset();
  }

  bool correct(const ClientPlace& place, int number, const std::vector<MovedNode>& corrected, double scale) {
    if (!has_session(number) || loop_correction || !(std::isfinite(scale) && scale > 0.0) ||
        (scale != 1.0 && !map.monocular))
      return false;
    const auto motions = motions_to(map, number, {place.client, begun->ns}, corrected, place.robot_from_camera, scale);
    if (motions.empty()) return false;
    forget_borrowed(number);
    if (number == session)
      carry_view([&] { return move_keyframes(map, number, motions); });
    else
      move_keyframes(map, number, motions);
    return true;
  }

  // The session's first keyframe. False where it would have nothing to hold on to.
  bool begin(const Frame& frame, Pyramid picture, int number) {
    if (!frame.shows_depth() && !picture.features)
      return !options.session.await_place && begin_without_depth(frame, std::move(picture), number);
    std::vector<Match> none;
    std::swap(matches, none);
    const View before = std::exchange(view, View());
    const int made = add_keyframe(map, {frame, picture, number, view, Motion(), driven}, {}, matches, options);
    if (static_cast<int>(matches.size()) < options.tracking.least_landmarks) {
      map.discard(made);
      if (shows_something(picture) && ++without_depth == kNotedAfter)
        notes.push_back(note_on_depth(frame, map, options));
      std::swap(matches, none), view = before;
      return false;
    }
    reference = made, reference_landmarks = matches.size();
    session = number, sessions_begun = number + 1;
    if (closer) closer->add(map, reference);
    motion = View();
    last = std::move(picture);
    return true;
  }

  bool begin_without_depth(const Frame& frame, Pyramid picture, int number) {
    std::vector<Match> seen;
    const auto made = mono_start.add(map, {frame, picture, number, View(), Motion(), driven}, seen, options);
    if (!made) return false;
    matches = std::move(seen);
    reference = made->second, reference_landmarks = matches.size(), view = map.keyframe(reference).view;
    session = number, sessions_begun = number + 1;
    if (closer) closer->add(map, made->first), closer->add(map, made->second);
    motion = View();
    last = std::move(picture);
    return true;
  }

  Tracked kept(Stamp stamp, bool keyframe) {
    driven.refused_m = std::numeric_limits<double>::infinity();
    last_stamp = stamp, last_driven = driven, lost_s = 0.0, lost_stamp = stamp;
    exchange.clear();
    map.keyframe(reference).frames.push_back(anchored(stamp, view * map.keyframe(reference).view.inverse()));
    if (const auto most = static_cast<std::size_t>(options.memory.frames); ++frames > most)
      frames = thin_frames(map, most);
    return {TrackState::tracked, pose_of(view), static_cast<int>(matches.size()), keyframe, session};
  }

  bool shows_something(const Pyramid& picture) const {
    if (picture.features) return picture.features->size() >= options.session.least_corners;
    DetectorOptions detector;
    detector.cell_px = options.tracking.cell_px;
    return static_cast<int>(detect_corners(picture, {}, detector).size()) >= options.session.least_corners;
  }

  Tracked lost(const Frame& frame, Pyramid picture) {
    motion = View();
    if (shows_something(picture)) lost_s += std::max(1e-3, seconds_between(lost_stamp, frame.stamp));
    lost_stamp = frame.stamp;
    exchange.miss(frame, picture);
    if (lost_s >= options.session.patience_s && begin(frame, std::move(picture), sessions_begun))
      return kept(frame.stamp, true);
    Tracked tracked;
    tracked.state = TrackState::lost, tracked.session = session;
    return tracked;
  }

  Tracked add(const Frame& frame) { return add(frame, make_pyramid(frame.grey)); }

  Tracked add(const FeatureFrame& frame) {
    Frame bare;
    bare.stamp = frame.stamp, bare.odometry_from_camera = frame.odometry_from_camera;
    Pyramid picture;
    picture.features = std::make_shared<const FrameFeatureGrid>(frame, map.camera);
    return add(bare, std::move(picture));
  }

  Tracked add(const Frame& frame, Pyramid picture) {
    if (!begun) begun = frame.stamp;
    go_on(driven, frame.odometry_from_camera);
    if (!noted_delay && !frame.depth.image.empty() && std::abs(frame.depth.delay_s) > kLongestInterval_s) {
      notes.push_back(note_on_delay(frame.depth.delay_s));
      noted_delay = true;
    }
    if (loop_correction &&
        (options.loops.wait ? loop_correction->due <= frame.stamp : loop_correction->work->is_done()))
      apply_loop_correction(frame.stamp);
    if (reference < 0) {
      exchange.miss(frame, picture), lost_stamp = frame.stamp;
      return begin(frame, std::move(picture), 0) ? kept(frame.stamp, true) : Tracked();
    }
    const double interval_s = seconds_between(last_stamp, frame.stamp);
    Attempt attempt = follow(frame, picture, interval_s);
    const bool just_now = lost_stamp == last_stamp || (lost_s == 0.0 && interval_s < kCarried_s);
    bool followed = just_now && is_good(attempt, true);
    if (followed && !map.monocular &&
        recent.contradict(attempt, {frame.stamp, driven, attempt.pose.view}, options.session))
      followed = false, attempt = Attempt(), go_back(Station(recent.oldest()));
    if (!followed) attempt = find_again(picture, frame.stamp, std::move(attempt));
    if (!followed && !is_good(attempt)) return lost(frame, std::move(picture));
    const double share = share_of(attempt);
    matches.clear(), dynamic_outliers.clear();
    for (std::size_t i = 0; i < attempt.found.size(); ++i) {
      if (!attempt.pose.fits[i]) {
        if (!map.landmark(attempt.found[i].landmark).borrowed) dynamic_outliers.push_back(attempt.found[i].pixel);
        continue;
      }
      matches.push_back(attempt.found[i]);
      ++map.landmark(attempt.found[i].landmark).found;
    }
    if (attempt.session != session || !followed) recent.clear();
    if (attempt.session != session) {
      session = attempt.session, motion = View();
      reference = most_seen(map, matches), reference_landmarks = matches.size();
    } else {
      motion = attempt.pose.view * view.inverse();
    }
    view = attempt.pose.view;
    if (map.monocular)
      mono_start.clear(), look_for_candidates(map, picture, view, attempt.motion, matches, options.tracking);
    const bool keyframe = keyframe_is_due();
    if (keyframe) make_keyframe(frame, picture, attempt.motion);
    last = std::move(picture);
    recent.add({frame.stamp, driven, view}, share);
    return kept(frame.stamp, keyframe);
  }

  MapPublisher publisher_for(const ClientPlace& place) const {
    return MapPublisher(place, SessionId{place.client, begun->ns}, options.tracking.sigma_px,
                        options.depth.inverse_depth_sigma);
  }

  int receive(const ClientPlace& place, int number, const std::vector<DescribedLandmark>& landmarks) {
    const SessionId own{place.client, begun ? begun->ns : 0};
    const int taken = borrowed.receive(map, number, of_others(landmarks, own, place.robot_from_camera));
    drop_what_is_gone();
    return taken;
  }

  bool has_session(int number) const { return number >= 0 && first_of(map, number) >= 0; }

  PlaceVerdict place_at(const ClientPlace& place, const PlaceAnswer& answer) {
    if (reference >= 0 && lost_s == 0.0) return PlaceVerdict::placed;
    const auto asked = exchange.take(answer.stamp);
    if (!asked) return PlaceVerdict::not_asked;
    const auto own = session_of(place.client, answer.map);
    const bool begins = !own;
    const int number = own.value_or(sessions_begun);
    if (!is_finite(answer.map_from_robot) || std::abs(answer.map_from_robot.q.norm() - 1.0) > 1e-6 ||
        answer.landmarks.empty() || !(begins || has_session(number)))
      return PlaceVerdict::unsound;
    const Pose3 map_from_camera =
        compose(compose(inverse(place.robot_from_camera), answer.map_from_robot), place.robot_from_camera);
    receive(place, number, answer.landmarks);
    auto checked = check_place(map, borrowed, number, *asked, view_of(map_from_camera), options.tracking);
    if (!checked) {
      if (begins) borrowed.forget(map, number);
      return PlaceVerdict::disagrees;
    }
    const Stamp newest = lost_stamp;
    map.monocular = map.monocular || (!asked->frame.shows_depth() && !asked->picture.features);
    matches = std::move(checked->matches), view = checked->view, motion = View();
    reference = add_keyframe(map, {asked->frame, asked->picture, number, view, Motion(), driven}, {}, matches, options);
    reference_landmarks = matches.size(), session = number;
    if (begins)
      sessions_begun = number + 1, reanchored.push_back({number, answer.map}), map.reanchored.push_back(number);
    if (closer) closer->add(map, reference);
    mono_start.clear();
    last = asked->picture;
    kept(asked->frame.stamp, true);
    if (asked->frame.stamp < newest)
      lost_s = 1e-3, lost_stamp = newest;  // since then the camera may have come anywhere
    return PlaceVerdict::taken;
  }
};

VisualClient::VisualClient(Pinhole camera, double baseline_m, ClientOptions options,
                           std::optional<matching::BinaryVocabulary> vocabulary)
    : state_(new State) {
  MAPWEAVE_EXPECT(camera.width >= 64 && camera.height >= 64 && camera.fx > 0 && camera.fy > 0,
                  "a camera of at least 64 x 64 pixels");
  state_->options = options;
  state_->map.camera = camera, state_->map.baseline_m = baseline_m;
  if (vocabulary) state_->closer.emplace(*vocabulary, options);
}
VisualClient::~VisualClient() = default;

Tracked VisualClient::add(const Frame& frame) {
  MAPWEAVE_EXPECT(frame.grey.width == state_->map.camera.width && frame.grey.height == state_->map.camera.height,
                  "pictures of the camera's size");
  return state_->add(frame);
}

Tracked VisualClient::add(const FeatureFrame& frame) {
  const std::size_t count = frame.features.points.size();
  MAPWEAVE_EXPECT(frame.features.descriptors.size() == count && frame.inverse_depths.size() == count,
                  "each feature has a descriptor and an inverse depth");
  MAPWEAVE_EXPECT(frame.level_factor >= 1.0, "levels of features grow coarser");
  return state_->add(frame);
}

std::shared_ptr<BackgroundWork> VisualClient::pending() const {
  return state_->loop_correction ? state_->loop_correction->work : nullptr;
}

void VisualClient::finish() {
  if (state_->loop_correction) state_->apply_loop_correction(state_->last_stamp);
}

std::optional<SessionId> VisualClient::run(const ClientPlace& place) const {
  return state_->begun ? std::optional(SessionId{place.client, state_->begun->ns}) : std::nullopt;
}

std::vector<MapUpdate> VisualClient::take_updates(const ClientPlace& place, PublishedDetail detail) {
  if (!state_->begun) return {};
  if (!state_->publisher) state_->publisher.emplace(state_->publisher_for(place));
  return state_->publisher->take(state_->map, detail);
}

void VisualClient::publish_again(const ClientPlace& place, const MapId& map) {
  if (const auto number = session_of(place.client, map); number && state_->publisher)
    state_->publisher->forget(*number);
}

std::vector<Map> VisualClient::maps(const ClientPlace& place) const {
  if (!state_->begun) return {};
  std::vector<Map> result;
  MapPublisher publisher = state_->publisher_for(place);
  for (const MapUpdate& update : publisher.take(state_->map, PublishedDetail::exact))
    result.push_back(updated(Map{}, update));
  return result;
}

int VisualClient::borrow(const ClientPlace& place, int session, const std::vector<DescribedLandmark>& landmarks) {
  return state_->has_session(session) ? state_->receive(place, session, landmarks) : 0;
}
bool VisualClient::correct(const ClientPlace& place, int session, const std::vector<MovedNode>& corrected,
                           double scale) {
  return state_->correct(place, session, corrected, scale);
}
std::optional<ClientView> VisualClient::view(const ClientPlace& place) const {
  if (state_->reference < 0 || state_->lost_s > 0.0) return std::nullopt;
  const Pose3 map_from_robot =
      compose(compose(place.robot_from_camera, pose_of(state_->view)), inverse(place.robot_from_camera));
  return ClientView{map_of(place.client, state_->session), state_->last_stamp, map_from_robot, state_->forgotten};
}
std::size_t VisualClient::borrowed() const { return state_->borrowed.size(); }
std::size_t VisualClient::borrowed_seen() const { return borrowed_of(state_->map); }

std::optional<PlaceRequest> VisualClient::place_request(const ClientPlace& place) {
  return state_->exchange.request(state_->map, place, state_->options);
}
PlaceVerdict VisualClient::place(const ClientPlace& place, const PlaceAnswer& answer) {
  return state_->place_at(place, answer);
}
std::vector<ReanchoredFrame> VisualClient::reanchored() const { return state_->reanchored; }

std::vector<SeenLandmark> VisualClient::seen() const {
  std::vector<SeenLandmark> result;
  for (const Match& match : state_->matches)
    result.push_back({match.landmark, match.pixel, (state_->view * state_->map.landmark(match.landmark).point).z()});
  return result;
}

std::vector<PlacedFrame> VisualClient::trajectory() const { return frames_of(state_->map); }
std::vector<PlacedFrame> VisualClient::keyframes() const { return keyframes_of(state_->map); }
std::vector<MappedLandmark> VisualClient::landmarks() const { return landmarks_of(state_->map); }
std::vector<int> VisualClient::sessions() const { return sessions_of(state_->map); }
std::vector<ClosedLoop> VisualClient::loops() const { return state_->loops; }
SensorCalibration VisualClient::sensor() const { return state_->map.calibration; }
std::vector<std::string> VisualClient::notes() const { return state_->notes; }

}  // namespace mapweave::visual
