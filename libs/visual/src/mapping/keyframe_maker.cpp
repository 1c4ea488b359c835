#include "keyframe_maker.h"

#include "pictures/detector.h"
#include "pictures/feature_grid.h"
#include "tracking/landmark_finder.h"
#include "tracking/place_finder.h"

#include <mapweave/core/median.h>
#include <mapweave/visual/depth_picture.h>

#include <algorithm>
#include <cmath>

namespace mapweave::visual {
namespace {

// Cosine and ratio within which a patch looks the same.
constexpr double kSameDirection = 0.94, kSameRange = 1.55;

// Keeps how the landmark looks from here where it has not been seen from about here.
void keep_appearance(LandmarkMap& map, ClientLandmark& landmark, const Pyramid& picture, const Match& match,
                     const View& view, int keyframe) {
  const Eigen::Vector3d ray = landmark.point - view.centre();
  for (const Appearance& appearance : landmark.appearances) {
    const Eigen::Vector3d other = landmark.point - map.view_of(appearance).centre();
    const double ratio = other.norm() / ray.norm();
    if (ray.dot(other) > kSameDirection * ray.norm() * other.norm() && ratio < kSameRange && ratio > 1.0 / kSameRange)
      return;
  }
  if (landmark.appearances.size() >= kMostAppearances) return;
  if (const auto patch = cut_patch(picture, match.pixel, match.level))
    landmark.appearances.push_back({*patch, match.pixel, keyframe, View()});
}

Sighting sighting_of(const Eigen::Vector2d& pixel, const Eigen::Vector2d& flow, int level,
                     const std::optional<MeasuredDepth>& depth, double sigma_px) {
  Sighting sighting;
  sighting.pixel = pixel;
  sighting.row_flow = flow;
  sighting.sigma_px = sigma_px * (1 << level);
  if (depth) {
    sighting.inverse_depth = depth->inverse_depth;
    sighting.inverse_depth_sigma = depth->sigma;
  }
  return sighting;
}

double middle_depth_of(const LandmarkMap& map, const View& view, const std::vector<Match>& matches) {
  std::vector<double> depths;
  for (const Match& match : matches) depths.push_back((view * map.landmark(match.landmark).point).z());
  return depths.empty() ? 1.0 : std::max(median(std::move(depths)), 1e-3);
}

// Depths of the features: read where there is a depth camera, else of the landmark next to each.
std::vector<float> depths_of(const LandmarkMap& map, const matching::OrbFeatures& features, const Frame& frame,
                             const DepthMeter& meter, const View& view, const std::vector<Match>& matches) {
  constexpr double kNear_px = 4.0;  // from a feature to the landmark that is taken for it
  std::vector<float> depths;
  for (const matching::FeaturePoint& point : features.points) {
    const Eigen::Vector2d pixel(static_cast<double>(point.u_px), static_cast<double>(point.v_px));
    double depth = 0.0;
    if (!frame.depth.image.empty()) {
      if (const auto reading = meter.reading(pixel)) depth = reading->depth_m();
    } else {
      double nearest = kNear_px;
      for (const Match& match : matches) {
        const double distance = (match.pixel - pixel).norm();
        if (distance < nearest && is_known(map.landmark(match.landmark))) {
          nearest = distance;
          depth = (view * map.landmark(match.landmark).point).z();
        }
      }
    }
    depths.push_back(static_cast<float>(depth));
  }
  return depths;
}

bool is_moving(const Eigen::Vector2d& pixel, const std::vector<Eigen::Vector2d>& dynamic_outliers) {
  constexpr double kNear_px = 50.0;  // of a person some metres away
  constexpr int kSeveral = 3;        // single outliers are wrong matches
  int near = 0;
  for (const Eigen::Vector2d& outlier : dynamic_outliers) near += (outlier - pixel).squaredNorm() < kNear_px * kNear_px;
  return near >= kSeveral;
}

Keyframe keyframe_of(const PosedFrame& posed) {
  Keyframe made;
  made.stamp = posed.frame.stamp;
  made.view = posed.view;
  made.session = posed.session;
  made.driven = posed.driven;
  return made;
}

// Of a frame that has features: those with a depth become landmarks.
int add_feature_keyframe(LandmarkMap& map, const PosedFrame& posed, std::vector<Match>& matches,
                         const ClientOptions& options) {
  const FrameFeatureGrid& features = *posed.picture.features;
  const View& view = posed.view;
  const auto sighting = [&](int feature) {
    Sighting seen;
    seen.pixel = features.pixel(feature);
    seen.sigma_px = options.tracking.sigma_px * (1 << features.level(feature));
    if (features.inverse_depth(feature) > 0.0) {
      seen.inverse_depth = features.inverse_depth(feature);
      seen.inverse_depth_sigma = options.depth.inverse_depth_sigma;
    }
    return seen;
  };
  Keyframe made = keyframe_of(posed);
  made.features = features.features();
  for (int feature = 0; feature < features.size(); ++feature) {
    const double inverse_depth = features.inverse_depth(feature);
    made.depths.push_back(inverse_depth > 0.0 ? static_cast<float>(1.0 / inverse_depth) : 0.0F);
  }
  for (const Match& match : matches) {
    float& depth = made.depths[static_cast<std::size_t>(match.feature)];
    if (!(depth > 0.0F)) depth = static_cast<float>(std::max(0.0, (view * map.landmark(match.landmark).point).z()));
  }
  const int number = map.add(std::move(made));
  std::vector<char> taken(static_cast<std::size_t>(features.size()), 0);
  for (const Match& match : matches) {
    const ClientLandmark& landmark = map.landmark(match.landmark);
    Sighting seen = sighting(match.feature);
    if (landmark.borrowed)
      map.widen(seen, landmark, (view * landmark.point).z());
    else
      taken[static_cast<std::size_t>(match.feature)] = 1;
    map.see(match.landmark, {number, seen});
  }
  const View map_from_camera = view.inverse();
  for (int feature = 0; feature < features.size(); ++feature) {
    const double inverse_depth = features.inverse_depth(feature) - map.calibration.inverse_depth_offset;
    if (taken[static_cast<std::size_t>(feature)] || !(features.inverse_depth(feature) > 0.0 && inverse_depth > 1e-3))
      continue;
    ClientLandmark landmark;
    landmark.point = map_from_camera * (map.camera.ray(features.pixel(feature)) / inverse_depth);
    landmark.descriptor = features.features().descriptors[static_cast<std::size_t>(feature)];
    const int id = map.add(std::move(landmark));
    map.see(id, {number, sighting(feature)});
    map.recent_landmarks.emplace_back(id, map.keyframe(number).serial);
    matches.push_back({id, features.pixel(feature), Eigen::Vector2d::Zero(), features.level(feature), feature});
  }
  return number;
}

}  // namespace

int add_keyframe(LandmarkMap& map, const PosedFrame& posed, const std::vector<Eigen::Vector2d>& dynamic_outliers,
                 std::vector<Match>& matches, const ClientOptions& options) {
  if (posed.picture.features) return add_feature_keyframe(map, posed, matches, options);
  const auto& [frame, picture, session, view, motion, driven] = posed;
  const double sigma_px = options.tracking.sigma_px;
  const DepthMeter meter(map, frame, picture, motion, options);
  const int number = map.add(keyframe_of(posed));
  std::vector<Eigen::Vector2d> occupied;
  for (const Match& match : matches) {
    ClientLandmark& landmark = map.landmark(match.landmark);
    const auto depth = meter.at(match.pixel, match.level, (view * landmark.point).z());
    Sighting sighting = sighting_of(match.pixel, match.row_flow, match.level, depth, sigma_px);
    if (landmark.borrowed)
      map.widen(sighting, landmark, (view * landmark.point).z());
    else
      occupied.push_back(match.pixel);
    map.see(match.landmark, {number, sighting});
    keep_appearance(map, landmark, picture, match, view, number);
  }
  const View map_from_camera = view.inverse();
  DetectorOptions detector;
  detector.cell_px = cell_of_scene(matches.size(), map.camera, options.tracking);
  if (detector.cell_px < options.tracking.cell_px) {
    detector.threshold = 5;
    detector.min_strength = 8;
  }  // weak ones are better than none
  const double middle_depth = map.monocular ? middle_depth_of(map, view, matches) : 0.0;
  if (map.monocular)
    for (const DepthCandidate& candidate : map.candidates) occupied.push_back(candidate.now);
  for (const Corner& corner : detect_corners(picture, occupied, detector)) {
    const auto patch = cut_patch(picture, corner.pixel, corner.level);
    if (!patch || is_moving(corner.pixel, dynamic_outliers)) continue;
    if (map.monocular) {
      DepthCandidate candidate;
      candidate.patch = *patch;
      candidate.pixel = candidate.now = corner.pixel;
      candidate.keyframe = number;
      candidate.keyframe_serial = map.keyframe(number).serial;
      candidate.row_flow = row_flow(map.camera, motion, corner.pixel, middle_depth);
      candidate.inverse_depth = candidate.sigma = 1.3 / middle_depth;  // from near to infinitely far
      map.candidates.push_back(candidate);
      continue;
    }
    const auto depth = meter.at(corner.pixel, corner.level);
    if (!depth || depth->at_edge) continue;
    const double inverse_depth = depth->inverse_depth - map.calibration.inverse_depth_offset;
    if (inverse_depth < 1e-3) continue;
    const Eigen::Vector2d flow = row_flow(map.camera, motion, corner.pixel, 1.0 / inverse_depth);
    ClientLandmark landmark;
    landmark.point =
        map_from_camera * (map.camera.ray(corner.pixel - map.calibration.readout_s * flow) / inverse_depth);
    landmark.appearances.push_back({*patch, corner.pixel, number, View()});
    landmark.colour = colour_at(frame, map.camera, corner.pixel);
    const int id = map.add(std::move(landmark));
    map.see(id, {number, sighting_of(corner.pixel, flow, corner.level, depth, sigma_px)});
    map.recent_landmarks.emplace_back(id, map.keyframe(number).serial);
    matches.push_back({id, corner.pixel, flow, corner.level});
  }
  Keyframe& keyframe = map.keyframe(number);
  keyframe.features = features_of(picture, options.tracking.features);
  keyframe.depths = depths_of(map, keyframe.features, frame, meter, view, matches);
  return number;
}

void see_borrowed(LandmarkMap& map, int keyframe, const Pyramid& picture, const Match& match, double sigma_px) {
  const View& view = map.keyframe(keyframe).view;
  map.see(match.landmark, {keyframe, map.sighting_of(match, sigma_px, &view)});
  if (!picture.features) keep_appearance(map, map.landmark(match.landmark), picture, match, view, keyframe);
}

}  // namespace mapweave::visual
