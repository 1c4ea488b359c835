#include "frame_alignment.h"
#include "keyframe_maker.h"
#include "landmark_finder.h"
#include "local_window.h"
#include "loop_closer.h"

#include <mapweave/core/error.h>
#include <mapweave/core/stamp.h>
#include <mapweave/matching/place_index.h>
#include <mapweave/visual/visual_client.h>

#include <algorithm>
#include <utility>

namespace mapweave::visual {
namespace {

constexpr int kCoarsest = 4, kFinest = 2;  // levels of the first alignment
constexpr std::size_t kPlaces = 5;         // that a picture is compared with, of those that look most alike
constexpr int kLatest = 10;                // keyframes that are no loop

// A frame, and where it is seen from a keyframe: it moves with it.
struct AnchoredFrame {
  Stamp stamp;
  int keyframe = 0;
  View frame_from_keyframe;
};

struct Attempt {
  std::vector<Match> found;
  PoseFromPoints pose;
  Motion motion;
};

}  // namespace

struct VisualClient::State {
  ClientOptions options;
  std::optional<matching::BinaryVocabulary> vocabulary;
  std::optional<matching::PlaceIndex> index;
  LandmarkMap map;
  LandmarkFinder finder;
  std::vector<AnchoredFrame> frames;

  // Of the last frame that was tracked.
  Pyramid last;
  Stamp last_stamp;
  View view, motion;  // camera_from_map; view from the view before
  std::vector<Match> matches;
  int reference = 0;  // the newest keyframe
  std::size_t reference_landmarks = 0;
  int loops = 0;

  Attempt locate(const Pyramid& picture, const View& start, const Motion& speed) {
    Attempt attempt;
    attempt.motion = speed;
    attempt.found =
        finder.find(map, near_keyframes(map, matches, start, options.tracking.near_keyframes), picture, start, speed, options.tracking);
    std::vector<Sighting> sightings;
    for (const Match& match : attempt.found) sightings.push_back(map.sighting_of(match, options.tracking.sigma_px));
    attempt.pose = pose_from_points(sightings, map.camera, start, map.flaws, options.tracking.gate_sigmas);
    return attempt;
  }

  bool is_good(const Attempt& attempt) const {
    const int seen = attempt.pose.count, found = static_cast<int>(attempt.found.size());
    if (seen >= options.tracking.least_landmarks) return 2 * seen >= found;
    return 2 * seen >= options.tracking.least_landmarks && 4 * seen >= 3 * found;  // few, but of one mind
  }

  Attempt follow(const Pyramid& picture, double interval_s) {
    std::vector<Eigen::Vector2d> pixels;
    std::vector<Eigen::Vector3d> points;
    for (const Match& match : matches) {
      const Eigen::Vector3d p = view * map.landmark(match.landmark).point;
      if (p.z() < 0.1) continue;
      pixels.push_back(map.camera.project(p)), points.push_back(p);
    }
    const View moved_by = align_frames(last, pixels, points, picture, map.camera, motion, kCoarsest, kFinest).to_from_from;
    return locate(picture, moved_by * view, motion_of(moved_by, interval_s));
  }

  // By features: first around where it was, then wherever it looks alike.
  Attempt find_again(const Pyramid& picture, double interval_s, Attempt best) {
    const matching::OrbFeatures features = features_of(picture[0], options.tracking.features);
    const auto try_near = [&](std::vector<int> keyframes) {
      const auto found = find_place(map, keyframes, features);
      if (!found) return;
      Attempt attempt = locate(picture, *found, motion_of(*found * view.inverse(), interval_s));
      if (attempt.pose.count > best.pose.count) best = std::move(attempt);
    };
    std::vector<int> around = near_keyframes(map, matches, view, 4);
    if (std::find(around.begin(), around.end(), reference) == around.end()) around.insert(around.begin(), reference);
    try_near(around);
    if (is_good(best) || !index) return best;
    const auto bag = vocabulary->describe_picture(features.descriptors).bag;
    for (const matching::SimilarPlace& place : index->query(bag, kPlaces)) {
      try_near({static_cast<int>(place.id.index)});
      if (is_good(best)) break;
    }
    return best;
  }

  bool keyframe_is_due() const {
    const View since = view * map.keyframe(reference).view.inverse();
    std::vector<double> depths;
    for (const Match& match : matches) depths.push_back((view * map.landmark(match.landmark).point).z());
    const auto middle = depths.begin() + static_cast<std::ptrdiff_t>(depths.size() / 2);
    std::nth_element(depths.begin(), middle, depths.end());
    return static_cast<double>(matches.size()) < options.keyframe.kept_share * static_cast<double>(reference_landmarks) ||
           Eigen::AngleAxisd(since.rotation).angle() > options.keyframe.turn_rad ||
           since.centre().norm() > options.keyframe.parallax * *middle;
  }

  void make_keyframe(const Frame& frame, const Pyramid& picture, const Motion& speed) {
    add_keyframe(map, frame, picture, view, speed, matches, options);
    reference = static_cast<int>(map.keyframes.size()) - 1;
    reference_landmarks = matches.size();
    if (reference > 0) adjust_window(map, options.window);
    look_for_loop(picture);
    view = map.keyframe(reference).view;
  }

  void look_for_loop(const Pyramid& picture) {
    if (!index) return;
    const auto bag = vocabulary->describe_picture(map.keyframe(reference).features.descriptors).bag;
    const auto alike = index->query(bag, kPlaces, [&](const NodeId& id) { return static_cast<int>(id.index) > reference - kLatest; });
    NodeId id;
    id.index = static_cast<std::uint32_t>(reference);
    index->add(id, bag);
    const auto loop = find_loop(map, finder, alike, picture, options);
    if (!loop) return;
    ++loops;
    close_loop(map, *loop);
    // The keyframe sees the earlier landmarks too.
    for (const Match& match : loop->matches) {
      Landmark& landmark = map.landmark(match.landmark);
      landmark.seen.push_back({reference, map.sighting_of(match, options.tracking.sigma_px)});
      map.keyframe(reference).landmarks.push_back(match.landmark);
      matches.push_back(match);
    }
    adjust_window(map, options.window);
  }

  Tracked begin(const Frame& frame, Pyramid picture) {
    Tracked tracked;
    make_keyframe(frame, picture, Motion());
    if (static_cast<int>(matches.size()) < options.tracking.least_landmarks) {  // nothing to hold on to yet
      map.keyframes.clear(), map.landmarks.clear(), matches.clear();
      if (index) index.emplace(vocabulary->words());
      return tracked;
    }
    tracked.keyframe = true;
    keep(frame, std::move(picture), tracked);
    return tracked;
  }

  void keep(const Frame& frame, Pyramid picture, Tracked& tracked) {
    last = std::move(picture), last_stamp = frame.stamp;
    frames.push_back({frame.stamp, reference, view * map.keyframe(reference).view.inverse()});
    tracked.state = TrackState::tracked;
    tracked.map_from_camera = pose_of(view);
    tracked.landmarks = static_cast<int>(matches.size());
  }

  Tracked add(const Frame& frame) {
    Pyramid picture = make_pyramid(frame.grey);
    if (map.keyframes.empty()) return begin(frame, std::move(picture));
    const double interval_s = seconds_between(last_stamp, frame.stamp);
    Attempt attempt = follow(picture, interval_s);
    if (!is_good(attempt)) attempt = find_again(picture, interval_s, std::move(attempt));
    Tracked tracked;
    if (!is_good(attempt)) {
      tracked.state = TrackState::lost;
      motion = View();
      return tracked;
    }
    matches.clear();
    for (std::size_t i = 0; i < attempt.found.size(); ++i) {
      if (!attempt.pose.fits[i]) continue;
      matches.push_back(attempt.found[i]);
      ++map.landmark(attempt.found[i].landmark).found;
    }
    motion = attempt.pose.view * view.inverse();
    view = attempt.pose.view;
    tracked.keyframe = keyframe_is_due();
    if (tracked.keyframe) make_keyframe(frame, picture, attempt.motion);
    keep(frame, std::move(picture), tracked);
    return tracked;
  }
};

VisualClient::VisualClient(PinholeCamera camera, double baseline_m, ClientOptions options,
                           std::optional<matching::BinaryVocabulary> vocabulary)
    : state_(new State) {
  MAPWEAVE_EXPECT(camera.width >= 64 && camera.height >= 64 && camera.fx > 0 && camera.fy > 0, "a camera of at least 64 x 64 pixels");
  state_->options = options;
  state_->map.camera = camera, state_->map.baseline_m = baseline_m;
  if (vocabulary) state_->index.emplace(vocabulary->words());
  state_->vocabulary = std::move(vocabulary);
}
VisualClient::~VisualClient() = default;

Tracked VisualClient::add(const Frame& frame) {
  MAPWEAVE_EXPECT(frame.grey.width == state_->map.camera.width && frame.grey.height == state_->map.camera.height,
                  "pictures of the camera's size");
  return state_->add(frame);
}

std::vector<SeenLandmark> VisualClient::seen() const {
  std::vector<SeenLandmark> result;
  for (const Match& match : state_->matches)
    result.push_back({match.landmark, match.pixel, (state_->view * state_->map.landmark(match.landmark).point).z()});
  return result;
}

std::vector<PlacedFrame> VisualClient::trajectory() const {
  std::vector<PlacedFrame> result;
  for (const AnchoredFrame& frame : state_->frames)
    result.push_back({frame.stamp, pose_of(frame.frame_from_keyframe * state_->map.keyframe(frame.keyframe).view)});
  return result;
}

std::vector<PlacedFrame> VisualClient::keyframes() const {
  std::vector<PlacedFrame> result;
  for (const Keyframe& keyframe : state_->map.keyframes) result.push_back({keyframe.stamp, pose_of(keyframe.view)});
  return result;
}

std::vector<MappedLandmark> VisualClient::landmarks() const {
  std::vector<MappedLandmark> result;
  for (const Landmark& landmark : state_->map.landmarks)
    if (!landmark.gone) result.push_back({landmark.point, static_cast<int>(landmark.seen.size())});
  return result;
}

int VisualClient::loops() const { return state_->loops; }
SensorFlaws VisualClient::sensor() const { return state_->map.flaws; }

}  // namespace mapweave::visual
