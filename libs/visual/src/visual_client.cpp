#include "input/sensor_notes.h"
#include "loops/loop_closing.h"
#include "loops/shared_loops.h"
#include "mapping/local_mapper.h"
#include "mapping/map_report.h"
#include "pictures/detector.h"
#include "sharing/place_exchange.h"
#include "tracking/tracker.h"

#include <mapweave/core/error.h>
#include <mapweave/visual/visual_client.h>

#include <algorithm>
#include <cmath>
#include <utility>

namespace mapweave::visual {

struct VisualClient::State {
  const ClientOptions options;
  LandmarkMap map;
  Tracker tracker;
  LocalMapper mapper;
  LoopClosing loops;
  BorrowedLandmarks borrowed;
  SharedKeyframes shared;
  SharedLoopDetector shared_loops;
  PlaceExchange exchange;
  std::optional<MapPublisher> publisher;
  SensorNotes notes;
  std::optional<Stamp> begun;
  int sessions_begun = 0;
  std::size_t found_by_shared = 0;

  State(const ClientOptions& given, const std::optional<matching::BinaryVocabulary>& vocabulary)
      : options(given),
        tracker(given),
        mapper(given),
        loops(vocabulary, given),
        shared(vocabulary, given),
        shared_loops(given) {}

  Tracked add(const FeatureFrame& frame) {
    Frame bare;
    bare.stamp = frame.stamp;
    bare.odometry_from_camera = frame.odometry_from_camera;
    Pyramid picture;
    picture.features = std::make_shared<const FrameFeatureGrid>(frame, map.camera);
    return add(bare, std::move(picture));
  }

  Tracked add(const Frame& frame, Pyramid picture) {
    if (!begun) begun = frame.stamp;
    notes.look_at(frame);
    tracker.go_on(frame.odometry_from_camera);
    if (loops.is_due(frame.stamp)) apply_loop_correction(frame.stamp);
    if (!tracker.has_begun()) return begin_first(frame, std::move(picture));
    const std::optional<Attempt> attempt = track(frame, picture);
    if (!attempt) {
      const auto found = find_by_shared(frame, picture);
      return found ? *found : lost(frame, std::move(picture));
    }
    const PosedFrame posed = posed_here(frame, picture, attempt->motion);
    tracker.add_matches(mapper.learn_depths(map, posed, tracker.place().matches));
    const bool is_keyframe = tracker.is_keyframe_due(map);
    if (is_keyframe) make_keyframe(posed);
    tracker.finish_tracked(frame.stamp, std::move(picture), share_of(*attempt));
    return kept(is_keyframe);
  }

  PosedFrame posed_here(const Frame& frame, const Pyramid& picture, const Motion& motion) const {
    return {frame, picture, tracker.place().session, tracker.place().view, motion, tracker.driven()};
  }

  // Where the camera is; nullopt where it is lost.
  std::optional<Attempt> track(const Frame& frame, const Pyramid& picture) {
    Attempt attempt = tracker.follow(map, frame, picture);
    bool is_followed = tracker.is_followed(map, attempt, frame.stamp);
    if (is_followed && !map.monocular) {
      if (const auto there = tracker.astray_since(map, attempt, frame.stamp)) {
        remove_since(map, tracker.place().session, there->stamp, [&](int keyframe) { loops.remove(keyframe); });
        tracker.go_back(map, *there);
        is_followed = false;
        attempt = Attempt();
      }
    }
    if (!is_followed) {
      attempt = tracker.find_again(map, loops.places(), picture, frame.stamp, std::move(attempt));
      if (!tracker.is_good(map, attempt)) return std::nullopt;
    }
    tracker.take(map, attempt, is_followed);
    return attempt;
  }

  // By what others mapped, whether or not a server is there.
  std::optional<Tracked> find_by_shared(const Frame& frame, const Pyramid& picture);

  void make_keyframe(const PosedFrame& frame) {
    borrow_shared(frame.session, frame.view);
    TrackedPlace place = tracker.place();
    place.reference = add_keyframe(map, frame, tracker.dynamic_outliers(), place.matches, options);
    borrowed.look_in_keyframe(map, place.reference, frame, place.matches, options.tracking);
    place.reference_landmarks = place.matches.size();
    mapper.refine(map, place.reference, place.matches, frame.picture);
    borrowed.tidy(map, place.session, map.keyframe(place.reference).view);
    for (int keyframe : mapper.cull_keyframes(map, place.reference)) loops.remove(keyframe);
    tracker.move_to(std::move(place));
    tracker.drop_what_is_gone(map);
    close_loop(frame);
    tracker.stand_at_reference(map);
  }

  void close_loop(const PosedFrame& frame) {
    auto loop = loops.look(map, tracker.place().reference, frame.picture, frame.motion);
    if (!loop && !loops.is_pending())
      loop = shared_loops.look(map, shared, tracker.place().reference, frame.picture, repeats_m());
    if (!loop) return;
    const int other = loop->fixed ? tracker.place().session : map.keyframe(loop->earlier).session;
    if (other != tracker.place().session) {
      for (int session : {tracker.place().session, other}) forget_borrowed(session);
      shared.forget(std::max(tracker.place().session, other));
      map.drop_reanchored(std::max(tracker.place().session, other));
      join_sessions(map, *loop);
      tracker.join(map.keyframe(tracker.place().reference).session);
    }
    loops.begin(map, std::move(*loop), frame.frame.stamp);
  }

  void apply_loop_correction(Stamp now) {
    forget_borrowed(tracker.place().session);  // its map changes under them
    const bool shared_move = !loops.is_on_shared();
    tracker.carry(map, [&] {
      const auto apply = [&] { return loops.apply(map, now); };
      return shared_move ? with_shared(apply) : apply();
    });
  }

  double repeats_m() const { return loops.places() != nullptr ? loops.places()->repeats_m() : kUnique_m; }

  // What others made moves along with the map that it was placed in.
  template <class Move>
  std::vector<double> with_shared(const Move& move) {
    if (shared.empty()) return move();
    std::vector<View> before;
    for (const Keyframe& keyframe : map.keyframes) before.push_back(keyframe.view);
    const std::vector<double> scales = move();
    shared.follow(map, before, scales);
    return scales;
  }

  void borrow_shared(int session, const View& view) {
    if (shared.empty()) return;
    borrowed.receive(map, session, shared.in_view(session, view, map.camera));
    tracker.drop_what_is_gone(map);
  }

  int keep_shared(const ClientPlace& place, int session, std::vector<SharedKeyframe> keyframes,
                  const std::vector<NodeId>& dropped);

  void forget_borrowed(int session) {
    borrowed.forget(map, session);
    tracker.drop_what_is_gone(map);
  }

  Tracked begin_first(const Frame& frame, Pyramid picture) {
    exchange.miss(frame, picture);
    tracker.finish_lost(frame.stamp, false);
    return begin(frame, std::move(picture), 0) ? kept(true) : Tracked();
  }

  Tracked lost(const Frame& frame, Pyramid picture) {
    tracker.finish_lost(frame.stamp, shows_something(picture));
    exchange.miss(frame, picture);
    if (tracker.lost_s() >= options.session.patience_s && begin(frame, std::move(picture), sessions_begun))
      return kept(true);
    Tracked tracked;
    tracked.state = TrackState::lost;
    tracked.session = tracker.place().session;
    return tracked;
  }

  // A session's first keyframe. False where it would have nothing to hold on to.
  bool begin(const Frame& frame, Pyramid picture, int session) {
    auto beginning = mapper.begin(map, {frame, picture, session, View(), Motion(), tracker.driven()});
    if (!beginning) {
      if ((frame.shows_depth() || picture.features) && shows_something(picture)) notes.miss_depth(frame, map, options);
      return false;
    }
    for (int keyframe : beginning->keyframes) loops.add(map, keyframe);
    begin_at(beginning->keyframes.back(), std::move(beginning->matches), frame.stamp, std::move(picture));
    return true;
  }

  // The camera is where a keyframe was made that nothing led to.
  void begin_at(int keyframe, std::vector<Match> matches, Stamp stamp, Pyramid picture) {
    const Keyframe& made = map.keyframe(keyframe);
    sessions_begun = std::max(sessions_begun, made.session + 1);
    const std::size_t landmarks = matches.size();
    tracker.begin_at({made.session, keyframe, landmarks, made.view, std::move(matches)}, stamp, std::move(picture));
  }

  Tracked kept(bool is_keyframe) {
    const TrackedPlace& place = tracker.place();
    exchange.clear();
    mapper.keep_frame(map, tracker.last_stamp(), place.view, place.reference);
    return {TrackState::tracked, pose_of(place.view), static_cast<int>(place.matches.size()), is_keyframe,
            place.session};
  }

  bool shows_something(const Pyramid& picture) const {
    if (picture.features) return picture.features->size() >= options.session.least_corners;
    DetectorOptions detector;
    detector.cell_px = options.tracking.cell_px;
    return static_cast<int>(detect_corners(picture, {}, detector).size()) >= options.session.least_corners;
  }

  MapPublisher publisher_for(const ClientPlace& place) const {
    return MapPublisher(place, SessionId{place.client, begun->ns}, options.tracking.sigma_px,
                        options.depth.inverse_depth_sigma);
  }

  bool has_session(int session) const { return session >= 0 && first_of(map, session) >= 0; }

  int receive(const ClientPlace& place, int session, const std::vector<DescribedLandmark>& landmarks) {
    const SessionId own{place.client, begun ? begun->ns : 0};
    const int taken = borrowed.receive(map, session, without_own(landmarks, map, own, place.robot_from_camera));
    tracker.drop_what_is_gone(map);
    return taken;
  }

  bool correct(const ClientPlace& place, int session, const std::vector<MovedNode>& corrected, double scale) {
    if (!has_session(session) || loops.is_pending() || !(std::isfinite(scale) && scale > 0.0) ||
        (scale != 1.0 && !map.monocular))
      return false;
    const auto motions = motions_to(map, session, {place.client, begun->ns}, corrected, place.robot_from_camera, scale);
    if (motions.empty()) return false;
    forget_borrowed(session);
    const auto move = [&] { return with_shared([&] { return move_keyframes(map, session, motions); }); };
    if (session == tracker.place().session)
      tracker.carry(map, move);
    else
      move();
    return true;
  }

  PlaceVerdict place_at(const ClientPlace& place, const PlaceAnswer& answer);

  // The frame becomes a keyframe that nothing led to.
  Tracked stand(const UnplacedFrame& frame, int session, CheckedPlace place) {
    const PosedFrame posed{frame.frame, frame.picture, session, place.view, Motion(), tracker.driven()};
    const int keyframe = add_keyframe(map, posed, {}, place.matches, options);
    loops.add(map, keyframe);
    mapper.forget_beginning();
    begin_at(keyframe, std::move(place.matches), frame.frame.stamp, frame.picture);
    return kept(true);
  }
};

PlaceVerdict VisualClient::State::place_at(const ClientPlace& place, const PlaceAnswer& answer) {
  if (tracker.has_place()) return PlaceVerdict::placed;
  const auto asked = exchange.take(answer.stamp);
  if (!asked) return PlaceVerdict::not_asked;
  const auto own = session_of(place.client, answer.map);
  const bool begins = !own;
  const int session = own.value_or(sessions_begun);
  if (!is_finite(answer.map_from_robot) || std::abs(answer.map_from_robot.q.norm() - 1.0) > 1e-6 ||
      answer.landmarks.empty() || !(begins || has_session(session)))
    return PlaceVerdict::unsound;
  const Pose3 map_from_camera =
      compose(compose(inverse(place.robot_from_camera), answer.map_from_robot), place.robot_from_camera);
  receive(place, session, answer.landmarks);
  auto checked = check_place(map, borrowed, session, *asked, view_of(map_from_camera), options.tracking);
  if (!checked) {
    if (begins) borrowed.drop(map, session);
    return PlaceVerdict::disagrees;
  }
  const Stamp newest = tracker.lost_stamp();
  map.monocular = map.monocular || (!asked->frame.shows_depth() && !asked->picture.features);
  stand(*asked, session, std::move(*checked));
  if (begins) map.reanchored.push_back({session, answer.map});
  if (asked->frame.stamp < newest) tracker.lose_since(newest);
  return PlaceVerdict::taken;
}

std::optional<Tracked> VisualClient::State::find_by_shared(const Frame& frame, const Pyramid& picture) {
  constexpr std::size_t kJudged = 2;  // of those that look most alike: bounds time
  if (shared.empty()) return std::nullopt;
  const UnplacedFrame lost_frame{
      frame, picture,
      picture.features ? picture.features->features() : features_of(picture, options.tracking.features)};
  JudgedPlace here;
  here.add({}, map.camera, View(), lost_frame.features, {});
  for (const NodeId& id : shared.alike(std::nullopt, lost_frame.features, kJudged)) {
    const auto found = shared.judged(id, here);
    if (!found || !has_session(found->session) ||
        !tracker.may_have_come_to(map, found->view, found->session, frame.stamp, repeats_m()))
      continue;
    borrow_shared(found->session, found->view);
    auto checked = check_place(map, borrowed, found->session, lost_frame, found->view, options.tracking);
    if (!checked) continue;
    ++found_by_shared;
    return stand(lost_frame, found->session, std::move(*checked));
  }
  return std::nullopt;
}

int VisualClient::State::keep_shared(const ClientPlace& place, int session, std::vector<SharedKeyframe> keyframes,
                                     const std::vector<NodeId>& dropped) {
  shared.drop(dropped);
  if (!has_session(session)) return 0;
  const Pose3 camera_from_robot = inverse(place.robot_from_camera);
  keyframes.erase(std::remove_if(keyframes.begin(), keyframes.end(), [](const auto& one) { return !is_sound(one); }),
                  keyframes.end());
  for (SharedKeyframe& one : keyframes) {
    one.map_from_camera = compose(camera_from_robot, one.map_from_camera);
    for (DescribedLandmark& landmark : one.landmarks)
      landmark = matching::transformed(landmark, {camera_from_robot, 1.0});
  }
  return shared.receive(map, {session, {place.client, begun->ns}, tracker.place().view.centre()}, keyframes);
}

VisualClient::VisualClient(Pinhole camera, double baseline_m, ClientOptions options,
                           std::optional<matching::BinaryVocabulary> vocabulary)
    : state_(new State(options, vocabulary)) {
  MAPWEAVE_EXPECT(camera.width >= 64 && camera.height >= 64 && camera.fx > 0 && camera.fy > 0,
                  "a camera of at least 64 x 64 pixels");
  state_->map.camera = camera;
  state_->map.baseline_m = baseline_m;
}
VisualClient::~VisualClient() = default;

Tracked VisualClient::add(const Frame& frame) {
  MAPWEAVE_EXPECT(frame.grey.width == state_->map.camera.width && frame.grey.height == state_->map.camera.height,
                  "pictures of the camera's size");
  return state_->add(frame, make_pyramid(frame.grey));
}

Tracked VisualClient::add(const FeatureFrame& frame) {
  const std::size_t count = frame.features.points.size();
  MAPWEAVE_EXPECT(frame.features.descriptors.size() == count && frame.inverse_depths.size() == count,
                  "each feature has a descriptor and an inverse depth");
  MAPWEAVE_EXPECT(frame.level_factor >= 1.0, "levels of features grow coarser");
  return state_->add(frame);
}

std::shared_ptr<BackgroundWork> VisualClient::pending() const { return state_->loops.work(); }

void VisualClient::finish() {
  if (state_->loops.is_pending()) state_->apply_loop_correction(state_->tracker.last_stamp());
}

std::optional<SessionId> VisualClient::run(const ClientPlace& place) const {
  return state_->begun ? std::optional(SessionId{place.client, state_->begun->ns}) : std::nullopt;
}

std::vector<MapUpdate> VisualClient::take_updates(const ClientPlace& place, PublishedDetail detail) {
  if (!state_->begun) return {};
  if (!state_->publisher) state_->publisher.emplace(state_->publisher_for(place));
  state_->map.remembers_forgotten = true;
  std::vector<MapUpdate> updates = state_->publisher->take(state_->map, detail);
  state_->map.forgotten_landmarks.clear();
  return updates;
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

std::size_t VisualClient::forgotten() const { return state_->mapper.forgotten(); }
std::vector<PlacedForgotten> VisualClient::forgotten_keyframes(const ClientPlace& place) const {
  return state_->begun ? state_->publisher_for(place).forgotten(state_->map) : std::vector<PlacedForgotten>{};
}

int VisualClient::borrow(const ClientPlace& place, int session, const std::vector<DescribedLandmark>& landmarks) {
  return state_->has_session(session) ? state_->receive(place, session, landmarks) : 0;
}
bool VisualClient::correct(const ClientPlace& place, int session, const std::vector<MovedNode>& corrected,
                           double scale) {
  return state_->correct(place, session, corrected, scale);
}
std::optional<ClientView> VisualClient::view(const ClientPlace& place) const {
  const Tracker& tracker = state_->tracker;
  if (!tracker.has_place()) return std::nullopt;
  const Pose3 map_from_robot =
      compose(compose(place.robot_from_camera, pose_of(tracker.place().view)), inverse(place.robot_from_camera));
  return ClientView{map_of(place.client, tracker.place().session),
                    tracker.last_stamp(),
                    map_from_robot,
                    state_->borrowed.times_forgotten(),
                    state_->shared.has_received() ? state_->shared.room() : 0,
                    state_->shared.times_lost(tracker.place().session)};
}
int VisualClient::keep_shared(const ClientPlace& place, int session, const std::vector<SharedKeyframe>& keyframes,
                              const std::vector<NodeId>& dropped) {
  return state_->keep_shared(place, session, keyframes, dropped);
}
std::vector<PlacedShared> VisualClient::shared_keyframes() const { return state_->shared.placed(); }
std::size_t VisualClient::dropped_shared() const { return state_->shared.dropped(); }
std::size_t VisualClient::found_by_shared() const { return state_->found_by_shared; }
std::size_t VisualClient::borrowed() const { return state_->borrowed.size(); }
std::size_t VisualClient::borrowed_seen() const { return borrowed_of(state_->map); }

std::optional<PlaceRequest> VisualClient::place_request(const ClientPlace& place) {
  return state_->exchange.request(state_->map, place, state_->options);
}
PlaceVerdict VisualClient::place(const ClientPlace& place, const PlaceAnswer& answer) {
  return state_->place_at(place, answer);
}
std::vector<ReanchoredFrame> VisualClient::reanchored() const { return state_->map.reanchored; }

std::vector<SeenLandmark> VisualClient::seen() const {
  std::vector<SeenLandmark> result;
  const TrackedPlace& place = state_->tracker.place();
  for (const Match& match : place.matches)
    result.push_back({match.landmark, match.pixel, (place.view * state_->map.landmark(match.landmark).point).z()});
  return result;
}

std::vector<PlacedFrame> VisualClient::trajectory() const { return frames_of(state_->map); }
std::vector<PlacedFrame> VisualClient::keyframes() const { return keyframes_of(state_->map); }
std::vector<MappedLandmark> VisualClient::landmarks() const { return landmarks_of(state_->map); }
std::vector<int> VisualClient::sessions() const { return sessions_of(state_->map); }
std::vector<ClosedLoop> VisualClient::loops() const { return state_->loops.closed(); }
SensorCalibration VisualClient::sensor() const { return state_->map.calibration; }
std::vector<std::string> VisualClient::notes() const { return state_->notes.all(); }

}  // namespace mapweave::visual
