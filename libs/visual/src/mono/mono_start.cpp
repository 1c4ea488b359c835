#include "mono_start.h"

#include "pictures/detector.h"
#include "tracking/frame_alignment.h"
#include "two_views.h"

#include <mapweave/core/median.h>

namespace mapweave::visual {
namespace {

constexpr std::size_t kLeastTracks = 50;   // fewer begin no map: another picture becomes the first
constexpr double kLeastKept = 0.5;         // of the tracks, before another first picture is taken
constexpr double kLeastShift = 0.01;       // median motion of the tracks worth a try, in focal lengths
constexpr double kMiddleDepth_m = 1.0;     // where nothing gives scale
constexpr double kLeastOdometry_m = 0.02;  // of a motion that gives scale

double scale_of(const TwoViews& views, const Frame& first, const Frame& second) {
  if (first.odometry_from_camera && second.odometry_from_camera) {
    const double moved_m = between(*first.odometry_from_camera, *second.odometry_from_camera).t.norm();
    if (moved_m > kLeastOdometry_m) return moved_m;
  }
  std::vector<double> depths;
  for (std::size_t i = 0; i < views.points.size(); ++i)
    if (views.fits[i]) depths.push_back(views.points[i].z());
  return kMiddleDepth_m / median(depths);
}

}  // namespace

void MonoStart::begin(const Frame& frame, const Pyramid& picture, const ClientOptions& options) {
  DetectorOptions detector;
  detector.cell_px = options.tracking.cell_px;
  tracks_.clear();
  for (const Corner& corner : detect_corners(picture, {}, detector))
    if (const auto patch = cut_patch(picture, corner.pixel, corner.level))
      tracks_.push_back({corner.pixel, corner.pixel, *patch});
  began_with_ = tracks_.size();
  first_frame_ = frame;
  first_ = last_ = picture;
  motion_ = View();
}

void MonoStart::follow(const Pyramid& picture, const Pinhole& camera, const ClientOptions& options) {
  ShownPoints shown;  // as if 1 m away
  for (const Track& track : tracks_) {
    shown.pixels.push_back(track.now);
    shown.points.push_back(camera.ray(track.now));
  }
  motion_ = align_frames(last_, shown, picture, camera, motion_).to_from_from;
  last_ = picture;
  std::vector<Track> kept;
  for (std::size_t i = 0; i < tracks_.size(); ++i) {
    const Eigen::Vector3d carried = motion_ * shown.points[i];
    if (!(carried.z() > kNearest_m)) continue;
    const auto match = align_patch(plain_patch(tracks_[i].patch), picture[tracks_[i].patch.level],
                                   camera.project(carried), static_cast<float>(options.tracking.reach_px));
    if (!match || static_cast<double>(match->correlation) < options.tracking.min_correlation) continue;
    tracks_[i].now = match->pixel;
    kept.push_back(tracks_[i]);
  }
  tracks_ = std::move(kept);
}

std::optional<std::pair<int, int>> MonoStart::add(LandmarkMap& map, const PosedFrame& posed,
                                                  std::vector<Match>& matches, const ClientOptions& options) {
  const Frame& frame = posed.frame;
  const Pyramid& picture = posed.picture;
  if (!tracks_.empty()) follow(picture, map.camera, options);
  if (tracks_.size() < kLeastTracks ||
      static_cast<double>(tracks_.size()) < kLeastKept * static_cast<double>(began_with_)) {
    begin(frame, picture, options);
    return std::nullopt;
  }
  std::vector<double> shifts;
  for (const Track& track : tracks_) shifts.push_back((track.now - track.first).norm());
  if (median(shifts) < kLeastShift * map.camera.fx) return std::nullopt;
  std::vector<PixelPair> pairs;
  for (const Track& track : tracks_)
    pairs.push_back({track.first, track.now, options.tracking.sigma_px * (1 << track.patch.level)});
  const auto views = relate_views(pairs, map.camera, {});
  if (!views) return std::nullopt;

  const double scale = scale_of(*views, first_frame_, frame);
  View second = views->second_from_first;
  second.translation *= scale;
  std::vector<Match> first_matches;
  for (std::size_t i = 0; i < pairs.size(); ++i) {
    if (!views->fits[i]) continue;
    ClientLandmark landmark;
    landmark.point = scale * views->points[i];
    const int id = map.add(std::move(landmark));
    first_matches.push_back({id, pairs[i].first, Eigen::Vector2d::Zero(), tracks_[i].patch.level});
    matches.push_back({id, pairs[i].second, Eigen::Vector2d::Zero(), tracks_[i].patch.level});
  }
  map.monocular = true;
  const int first = add_keyframe(map, {first_frame_, first_, posed.session, View(), Motion(), posed.driven}, {},
                                 first_matches, options);
  const int last =
      add_keyframe(map, {frame, picture, posed.session, second, Motion(), posed.driven}, {}, matches, options);
  clear();
  return std::pair(first, last);
}

}  // namespace mapweave::visual
