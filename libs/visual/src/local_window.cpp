#include "local_window.h"

#include "bundle.h"

#include <algorithm>
#include <map>

namespace mapweave::visual {
namespace {

constexpr int kLeastShared = 15;  // landmarks, of a keyframe in the window

std::vector<std::pair<int, int>> most_first(const std::map<int, int>& counts) {  // (-count, -number): of equals the newer
  std::vector<std::pair<int, int>> order;
  for (const auto& [number, count] : counts) order.emplace_back(-count, -number);
  std::sort(order.begin(), order.end());
  return order;
}

FlawPrior prior_of(const LandmarkMap& map, const WindowOptions& options) {
  FlawPrior prior;
  if (options.learn_readout) prior.readout_step_s = 0.002, prior.readout_s = 0.02;
  if (options.learn_depth_offset) {
    constexpr double kBaselineOfDepthCameras_m = 0.075;
    const double pixel = 1.0 / (map.camera.fx * (map.baseline_m > 0 ? map.baseline_m : kBaselineOfDepthCameras_m));
    prior.inverse_depth_step = 0.02 * pixel, prior.inverse_depth = 0.2 * pixel;
  }
  return prior;
}

void forget(LandmarkMap& map, int id, std::size_t sighting) {
  Landmark& landmark = map.landmark(id);
  auto& listed = map.keyframe(landmark.seen[sighting].keyframe).landmarks;
  listed.erase(std::remove(listed.begin(), listed.end(), id), listed.end());
  landmark.seen.erase(landmark.seen.begin() + static_cast<std::ptrdiff_t>(sighting));
  if (landmark.seen.empty()) landmark.gone = true;
}

}  // namespace

void adjust_window(LandmarkMap& map, const WindowOptions& options) {
  const int newest = static_cast<int>(map.keyframes.size()) - 1;
  std::map<int, int> shared;
  for (int id : map.keyframe(newest).landmarks)
    for (const Observation& o : map.landmark(id).seen) ++shared[o.keyframe];
  shared.erase(newest);
  std::vector<int> chosen{newest};
  for (const auto& [count, number] : most_first(shared))
    if (static_cast<int>(chosen.size()) < options.keyframes && -count >= kLeastShared) chosen.push_back(-number);

  Bundle bundle;
  std::map<int, int> view_of_keyframe;
  const auto add_view = [&](int number, bool fixed) {
    view_of_keyframe[number] = static_cast<int>(bundle.views.size());
    bundle.views.push_back(map.keyframe(number).view);
    bundle.fixed.push_back(fixed ? 1 : 0);
  };
  for (int number : chosen) add_view(number, number == 0);

  std::vector<int> ids;
  for (int number : chosen) ids.insert(ids.end(), map.keyframe(number).landmarks.begin(), map.keyframe(number).landmarks.end());
  std::sort(ids.begin(), ids.end());
  ids.erase(std::unique(ids.begin(), ids.end()), ids.end());
  std::map<int, int> others;
  for (int id : ids)
    for (const Observation& o : map.landmark(id).seen)
      if (view_of_keyframe.count(o.keyframe) == 0) ++others[o.keyframe];
  int held = 0;
  for (const auto& [count, number] : most_first(others))
    if (held++ < options.fixed_keyframes) add_view(-number, true);
  if (std::find(bundle.fixed.begin(), bundle.fixed.end(), 1) == bundle.fixed.end()) bundle.fixed[chosen.size() - 1] = 1;

  std::vector<std::pair<int, std::size_t>> origin;  // landmark, sighting
  for (int id : ids) {
    const Landmark& landmark = map.landmark(id);
    for (std::size_t i = 0; i < landmark.seen.size(); ++i) {
      const auto found = view_of_keyframe.find(landmark.seen[i].keyframe);
      if (found == view_of_keyframe.end()) continue;
      bundle.observations.push_back({found->second, static_cast<int>(bundle.points.size()), landmark.seen[i].sighting, true});
      origin.emplace_back(id, i);
    }
    bundle.points.push_back(landmark.point);
  }
  bundle.flaws = map.flaws;
  BundleOptions bundle_options;
  bundle_options.most_steps = options.steps;
  bundle_options.prior = prior_of(map, options);
  adjust(bundle, map.camera, bundle_options);

  map.flaws = bundle.flaws;
  map.flaws.readout_s = std::max(0.0, map.flaws.readout_s);  // rows are read downwards
  for (std::size_t i = 0; i < chosen.size(); ++i) map.keyframe(chosen[i]).view = bundle.views[i];
  for (std::size_t i = 0; i < ids.size(); ++i) map.landmark(ids[i]).point = bundle.points[i];
  for (std::size_t i = bundle.observations.size(); i-- > 0;)
    if (!bundle.observations[i].fits) forget(map, origin[i].first, origin[i].second);
}

}  // namespace mapweave::visual
