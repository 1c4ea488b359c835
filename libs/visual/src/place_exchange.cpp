#include "place_exchange.h"

#include "depth.h"
#include "place_finder.h"

namespace mapweave::visual {
namespace {

constexpr std::size_t kWaitedFor = 4;             // requests; older answers are about another place
constexpr std::size_t kLeastTogether = 12;        // matches that give a pose of their own
constexpr double kNear_m = 0.3, kNear_rad = 0.1;  // of the view that was expected
constexpr double kFar = 0.05, kClose = 0.015;     // widths of the picture: where a landmark is looked for
constexpr int kLeastShown = 20;                   // features of a request, and matches that confirm an answer
constexpr double kShownShare = 0.6;               // of the landmarks found

}  // namespace

FrameFeatureGrid grid_of(const matching::OrbFeatures& features, const Pinhole& camera) {
  FeatureFrame frame;
  frame.features = features, frame.inverse_depths.assign(features.points.size(), 0.0F);
  return FrameFeatureGrid(frame, camera);
}

std::vector<DescribedLandmark> of_others(const std::vector<DescribedLandmark>& landmarks, const SessionId& own,
                                         const Pose3& robot_from_camera) {
  const Pose3 camera_from_robot = inverse(robot_from_camera);
  std::vector<DescribedLandmark> result;
  for (const DescribedLandmark& landmark : landmarks)
    if (landmark.id.session != own) result.push_back(matching::transformed(landmark, {camera_from_robot, 1.0}));
  return result;
}

PoseFromPoints agreement(const LandmarkMap& map, const std::vector<Match>& found, const View& view,
                         const TrackingOptions& options) {
  std::vector<Sighting> sightings;
  for (const Match& match : found) sightings.push_back(map.sighting_of(match, options.sigma_px, &view));
  if (found.size() >= kLeastTogether) {
    PoseFromPoints pose = pose_from_points(sightings, map.camera, view, map.calibration, options.gate_sigmas);
    const View apart = pose.view * view.inverse();
    if (2 * pose.count > static_cast<int>(found.size()) && apart.translation.norm() < kNear_m &&
        Eigen::AngleAxisd(apart.rotation).angle() < kNear_rad)
      return pose;
  }
  PoseFromPoints here;
  here.view = view;
  Residual r;
  for (const Sighting& sighting : sightings) {
    here.fits.push_back(residual_of(sighting, view * sighting.point_in_map, map.camera, map.calibration, r) &&
                        r.value.head<2>().norm() < options.gate_sigmas);
    here.count += here.fits.back();
  }
  return here;
}

std::optional<PlaceRequest> PlaceExchange::request(const LandmarkMap& map, const ClientPlace& place,
                                                   const ClientOptions& options) {
  if (!missed_) return std::nullopt;
  UnplacedFrame asked = std::move(*missed_);
  missed_.reset();
  std::vector<float> depths;
  if (asked.picture.features) {
    asked.features = asked.picture.features->features();
    for (int i = 0; i < asked.picture.features->size(); ++i) {
      const double inverse_depth = asked.picture.features->inverse_depth(i);
      depths.push_back(inverse_depth > 0.0 ? static_cast<float>(1.0 / inverse_depth) : 0.0F);
    }
  } else {
    asked.features = features_of(asked.picture, options.tracking.features);
    const DepthMeter meter(map, asked.frame, asked.picture, Motion(), options);
    for (const matching::FeaturePoint& point : asked.features.points) {
      const auto reading = asked.frame.depth.image.empty() ? std::nullopt : meter.reading({point.u_px, point.v_px});
      depths.push_back(reading ? static_cast<float>(reading->depth_m()) : 0.0F);
    }
  }
  if (asked.features.points.size() < static_cast<std::size_t>(kLeastShown)) return std::nullopt;
  PlaceRequest request{asked.frame.stamp, packed(asked.features, depths, geometry_of(map, place.robot_from_camera))};
  asked_.push_back(std::move(asked));
  if (asked_.size() > kWaitedFor) asked_.pop_front();
  return request;
}

std::optional<UnplacedFrame> PlaceExchange::take(Stamp stamp) {
  for (auto asked = asked_.begin(); asked != asked_.end(); ++asked) {
    if (asked->frame.stamp != stamp) continue;
    UnplacedFrame result = std::move(*asked);
    asked_.erase(asked);
    return result;
  }
  return std::nullopt;
}

std::optional<CheckedPlace> check_place(LandmarkMap& map, BorrowedLandmarks& borrowed, int session,
                                        const UnplacedFrame& asked, const View& view, const TrackingOptions& options) {
  const FrameFeatureGrid grid = grid_of(asked.features, map.camera);
  CheckedPlace place{view, {}};
  const auto drop_all = [&] { borrowed.keep(map, place.matches, std::vector<char>(place.matches.size(), 0)); };
  for (const double reach : {kFar, kClose}) {
    drop_all();
    place.matches = borrowed.look(map, session, grid, place.view, Motion(), {}, reach * map.camera.width,
                                  asked.picture.features ? 0.0 : kFeature_px);
    const PoseFromPoints pose = agreement(map, place.matches, place.view, options);
    if (pose.count < kLeastShown || pose.count < kShownShare * static_cast<double>(place.matches.size())) {
      drop_all();
      return std::nullopt;
    }
    borrowed.keep(map, place.matches, pose.fits);
    place.view = pose.view;
  }
  return place;
}

}  // namespace mapweave::visual
