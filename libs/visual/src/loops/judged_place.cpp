#include "judged_place.h"

namespace mapweave::visual {

void JudgedPlace::add(const NodeId& id, const Pinhole& camera, const View& side_from_camera,
                      const matching::OrbFeatures& features, const std::vector<float>& depths) {
  auto& of_feature = landmark_of_feature.emplace_back(features.points.size(), -1);
  for (std::size_t i = 0; i < depths.size(); ++i) {
    if (!(depths[i] > 0.0F)) continue;
    const matching::FeaturePoint& point = features.points[i];
    const Eigen::Vector3d ray = camera.ray({static_cast<double>(point.u_px), static_cast<double>(point.v_px)});
    of_feature[i] = static_cast<std::int32_t>(view.landmarks.size());
    view.landmarks.push_back({side_from_camera * (ray * static_cast<double>(depths[i])), features.descriptors[i]});
  }
  matching::KeyframeView side;
  side.id = id;
  side.camera = camera;
  side.side_from_camera = pose_of(side_from_camera.inverse());
  side.features = matching::view_of(features);
  side.landmark_of_feature = of_feature.data();
  view.keyframes.push_back(side);
}

std::vector<int> with_covisible(const LandmarkMap& map, int number, std::size_t most) {
  std::vector<int> result{number};
  for (const CovisibleKeyframe& shared : most_first(covisible(map, number)))
    if (result.size() <= most) result.push_back(shared.keyframe);
  return result;
}

JudgedPlace place_of(const LandmarkMap& map, const std::vector<int>& keyframes) {
  JudgedPlace place;
  const View side_from_map = map.keyframe(keyframes.front()).view;
  place.view.id.index = map.keyframe(keyframes.front()).serial;
  place.view.metric = !map.monocular;
  place.landmark_of_feature.reserve(keyframes.size());
  for (int number : keyframes) {
    const Keyframe& keyframe = map.keyframe(number);
    NodeId id;
    id.index = keyframe.serial;
    place.add(id, map.camera, side_from_map * keyframe.view.inverse(), keyframe.features, keyframe.depths);
  }
  return place;
}

std::optional<Sim3> first_from_second(const matching::PlaceView& first, const matching::PlaceView& second,
                                      double least_probability, std::uint64_t seed) {
  matching::VisualJudgeOptions judge;
  judge.neighbours = 1;
  judge.alignment.seed = seed;
  const bool in_order = first.id < second.id;
  const Judgement judgement =
      in_order ? judge_places(first, second, judge).judgement : judge_places(second, first, judge).judgement;
  if (judgement.doubt != Reason::none || judgement.probability < least_probability) return std::nullopt;
  const Sim3& found = judgement.hypotheses.front().a_from_b;
  return in_order ? found : inverse(found);
}

}  // namespace mapweave::visual
