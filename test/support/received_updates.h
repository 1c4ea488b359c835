#pragma once
// What two robots in an apartment publish to their edge's camera map server.

#include <support/feature_team.h>

namespace mapweave::test {

inline tiers::ServerOptions sharing(tiers::Sharing share) {
  tiers::ServerOptions options;
  options.share = share;
  return options;
}

inline simulation::WorldOptions two_in_an_apartment() {
  auto options = camera_world(simulation::PlanKind::apartment, 7, 2);
  options.robots[0].first_room = 0;
  options.robots[0].last_room = 3;
  options.robots[0].length_m = 25.0;
  options.robots[1].first_room = 1;
  options.robots[1].last_room = 4;
  options.robots[1].length_m = 25.0;
  return options;
}

// As if the same surfaces looked otherwise: by another light, or in another building, whose wallpapers are the same
// ones in simulated worlds.
inline std::function<FeatureTeam::Shot(std::size_t)> in_other_looks(std::function<FeatureTeam::Shot(std::size_t)> see) {
  return [see = std::move(see)](std::size_t number) {
    FeatureTeam::Shot shot = see(number);
    for (auto& descriptor : shot.frame.features.descriptors)
      for (std::size_t word = 0; word < descriptor.size(); ++word)
        descriptor[word] ^= (word + 1) * 0x9e3779b97f4a7c15ULL;
    return shot;
  };
}

// Updates of the apartment, as they were stored.
struct ReceivedUpdate {
  SessionId from;
  std::string bytes;
};
inline std::vector<ReceivedUpdate> received_in_the_apartment() {
  auto options = two_in_an_apartment();
  for (auto& robot : options.robots) robot.length_m = 12.0;
  FeatureTeam team(options, tiers::ServerOptions{});
  std::vector<ReceivedUpdate> received_updates;
  team.overheard = [&](const FeatureTeam::Robot& robot, const std::string& bytes) {
    received_updates.push_back({*robot.client->run(robot.place), bytes});
  };
  team.run();
  return received_updates;
}
inline const std::vector<ReceivedUpdate>& received_updates() {
  static const std::vector<ReceivedUpdate> all = received_in_the_apartment();
  return all;
}
// Where a robot is by a camera without depth, whose scale is so many times the true one: of its path, and of
// what it sees.
inline Pose3 single(Pose3 map_from_robot, const Eigen::Vector3d& camera_m, double scale) {
  const Eigen::Vector3d gone_m = transformed(camera_m, map_from_robot) - camera_m;
  map_from_robot.t += (scale - 1.0) * gone_m;
  return map_from_robot;
}
// What such a camera publishes.
inline MapUpdate single(MapUpdate update, double scale) {
  const Eigen::Vector3d camera_m = keyframe_of(update.nodes.front())->geometry->robot_from_camera.t;
  for (Node& node : update.nodes) {
    KeyframeFeatures features = *keyframe_of(node);
    for (KeyframePoint& point : features.points) point.inverse_depth = 0;
    node.payload = std::make_shared<const Payload>(std::move(features));
    node.map_from_node = single(node.map_from_node, camera_m, scale);
  }
  for (Landmark& landmark : update.landmarks) {
    landmark.point_units = landmark_units(camera_m + scale * (landmark.point_in_anchor() - camera_m));
    for (LandmarkSighting& sighting : landmark.seen) sighting.inverse_depth = 0;
  }
  update.borrowed.clear();
  return update;
}

inline Hello hello_of(const SessionId& session) { return {session, matching::shipped_vocabulary().hash()}; }

inline std::string sealed(tiers::VisualServer& server, int threads = 1) {
  WorkerPool pool(threads);
  const auto silent = make_silent_progress();
  const auto result = server.seal(pool, *silent);
  std::string bytes;
  for (const auto& component : result.components) bytes += encode(difference(Map{}, component.map));
  return bytes;
}

}  // namespace mapweave::test
