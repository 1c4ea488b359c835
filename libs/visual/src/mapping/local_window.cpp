#include "local_window.h"

#include "geometry/bundle_sighting.h"

#include <algorithm>

namespace mapweave::visual {
namespace {

constexpr int kLeastShared = 15;    // landmarks, of a keyframe in the window
constexpr int kLeastBorrowed = 20;  // landmarks, that hold a window

graph::CalibrationPrior prior_of(const LandmarkMap& map, const WindowOptions& options) {
  graph::CalibrationPrior prior;
  if (options.learn_readout) {
    prior.readout_step_s = 0.002;
    prior.readout_s = 0.02;
  }
  if (options.learn_depth_offset && !map.monocular) {
    constexpr double kBaselineOfDepthCameras_m = 0.075;  // as kInverseDepthSigma_per_m (maps/map_noise.h)
    const double pixel = 1.0 / (map.camera.fx * (map.baseline_m > 0 ? map.baseline_m : kBaselineOfDepthCameras_m));
    prior.inverse_depth_step = 0.02 * pixel;
    prior.inverse_depth = 0.2 * pixel;
  }
  return prior;
}

constexpr int kNoView = -1;

// Whether the window's views determine where the landmark is.
bool is_held(const ClientLandmark& landmark, const std::vector<int>& view_of_keyframe, bool knows_depth) {
  if (landmark.borrowed) return true;
  int views = 0;
  for (const Observation& o : landmark.seen) {
    if (view_of_keyframe[static_cast<std::size_t>(o.keyframe)] == kNoView) continue;
    if (knows_depth && o.sighting.inverse_depth_sigma > 0.0) return true;
    ++views;
  }
  return views > 1;
}

}  // namespace

void adjust_window(LandmarkMap& map, int newest, const WindowOptions& options) {
  std::vector<int> chosen{newest};
  for (const CovisibleKeyframe& shared : most_first(covisible(map, newest)))
    if (static_cast<int>(chosen.size()) < options.keyframes && shared.landmarks >= kLeastShared)
      chosen.push_back(shared.keyframe);

  graph::Bundle bundle;
  bundle.cameras.push_back(map.camera);
  std::vector<int> view_of_keyframe(map.keyframes.size(), kNoView);
  const auto add_view = [&](int number, bool fixed) {
    view_of_keyframe[static_cast<std::size_t>(number)] = static_cast<int>(bundle.views.size());
    bundle.views.push_back({map.keyframe(number).view, 0, fixed});
  };
  std::vector<int> ids;
  for (int number : chosen)
    ids.insert(ids.end(), map.keyframe(number).landmarks.begin(), map.keyframe(number).landmarks.end());
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  const bool held_by_borrowed =
      std::count_if(ids.begin(), ids.end(), [&](int id) { return map.landmark(id).borrowed; }) >= kLeastBorrowed;

  const int session = map.keyframe(newest).session, first = first_of(map, session);
  const bool is_reanchored = map.is_reanchored(session);
  // Depths learnt from the camera's own motion err together with it: they say nothing of the scale that others give.
  const bool knows_depth = !(map.monocular && is_reanchored && held_by_borrowed);
  for (int number : chosen) add_view(number, number == first && !(is_reanchored && held_by_borrowed));
  std::vector<int> counts(map.keyframes.size(), 0);
  for (int id : ids)
    for (const Observation& o : map.landmark(id).seen) ++counts[static_cast<std::size_t>(o.keyframe)];
  std::vector<CovisibleKeyframe> others;
  for (std::size_t i = 0; i < counts.size(); ++i)
    if (counts[i] > 0 && view_of_keyframe[i] == kNoView) others.push_back({static_cast<int>(i), counts[i]});
  int held = 0;
  for (const CovisibleKeyframe& other : most_first(std::move(others)))
    if (held++ < options.fixed_keyframes) add_view(other.keyframe, true);
  auto fixed_views =
      std::count_if(bundle.views.begin(), bundle.views.end(), [](const graph::BundleView& view) { return view.fixed; });
  if (!held_by_borrowed && fixed_views == 0) {
    bundle.views[chosen.size() - 1].fixed = true;
    ++fixed_views;
  }
  // Where nothing measures depth, two views hold the scale.
  for (; map.monocular && !held_by_borrowed && fixed_views < 2; ++fixed_views) {
    std::size_t oldest = chosen.size();
    for (std::size_t i = 0; i < chosen.size(); ++i)
      if (!bundle.views[i].fixed &&
          (oldest == chosen.size() || map.keyframe(chosen[i]).serial < map.keyframe(chosen[oldest]).serial))
        oldest = i;
    if (oldest == chosen.size()) break;
    bundle.views[oldest].fixed = true;
  }
  ids.erase(std::remove_if(ids.begin(), ids.end(),
                           [&](int id) { return !is_held(map.landmark(id), view_of_keyframe, knows_depth); }),
            ids.end());

  std::vector<std::pair<int, int>> origin;  // landmark, keyframe
  for (int id : ids) {
    const ClientLandmark& landmark = map.landmark(id);
    for (const Observation& seen : landmark.seen) {
      const int view = view_of_keyframe[static_cast<std::size_t>(seen.keyframe)];
      if (view == kNoView) continue;
      bundle.sightings.push_back(bundle_sighting(view, bundle.points.size(), seen.sighting));
      if (!knows_depth) bundle.sightings.back().inverse_depth_sigma = 0.0;
      origin.emplace_back(id, seen.keyframe);
    }
    bundle.points.push_back(landmark.point);
    bundle.fixed_points.push_back(landmark.borrowed ? 1 : 0);
  }
  bundle.calibration = map.calibration;
  graph::BundleOptions adjusting = bundle_options(options.steps);
  adjusting.prior = prior_of(map, options);
  graph::adjust(bundle, adjusting);

  map.calibration = bundle.calibration;
  map.calibration.readout_s = std::max(0.0, map.calibration.readout_s);  // rows are read downwards
  for (std::size_t i = 0; i < chosen.size(); ++i) map.keyframe(chosen[i]).view = bundle.views[i].view;
  for (std::size_t i = 0; i < ids.size(); ++i) map.landmark(ids[i]).point = bundle.points[i];
  for (std::size_t i = 0; i < bundle.sightings.size(); ++i)
    if (!bundle.sightings[i].fits) map.forget(origin[i].first, origin[i].second);
}

}  // namespace mapweave::visual
