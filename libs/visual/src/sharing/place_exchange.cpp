#include "place_exchange.h"

#include "shown_landmarks.h"

#include "mapping/depth.h"
#include "tracking/place_finder.h"

namespace mapweave::visual {
namespace {

// Answers, each with its frame and picture: bounds memory, the oldest is given up.
constexpr std::size_t kWaitedFor = 4;

}  // namespace

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
    place.matches =
        borrowed.look(map, {grid, asked.picture.features ? 0.0 : kFeature_px, session, place.view, Motion()}, {},
                      reach * map.camera.width);
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
