#pragma once
// The maps of a robot with two cameras in an apartment, by features.

#include <mapweave/maps/map_update.h>
#include <mapweave/matching/binary_vocabulary.h>
#include <mapweave/rig/rig.h>
#include <mapweave/simulation/feature_sensor.h>
#include <mapweave/visual/visual_client.h>
#include <support/seen_frame.h>

#include <algorithm>

namespace mapweave::test {

struct Blindness {
  std::string camera;
  double begin_s = 0.0, end_s = 0.0;
};

struct DrivenRobot {
  std::vector<rig::RigMember> members;
  std::vector<StampedPose> odometry, truth;
};

inline simulation::WorldOptions world_of_two_cameras(double length_m) {
  simulation::WorldOptions options;
  options.seed = 7;
  options.buildings.resize(1);
  options.buildings[0].seed = 7;
  options.cameras.resize(2);
  for (std::size_t i = 0; i < 2; ++i) {
    simulation::CameraOptions& camera = options.cameras[i];
    camera.id = i == 0 ? "ahead" : "back";
    camera.kind = simulation::SimulatedCameraKind::rgbd;
    camera.frames_per_second = 12.0;
    if (i == 1) {
      camera.yaw_deg = 180.0;
      camera.x_m = -0.15;
    }
  }
  options.robots.resize(1);
  options.robots[0].id = "alpha";
  options.robots[0].last_room = 3;
  options.robots[0].length_m = length_m;
  return options;
}

// The sessions of a client, as members of a rig.
inline void finish(visual::VisualClient& client, const std::string& name, const Pose3& robot_from_camera,
                   std::vector<rig::RigMember>& members) {
  client.finish();
  const visual::ClientPlace place{{RobotId("alpha"), SensorId(name)}, robot_from_camera};
  const std::vector<int> sessions = client.sessions();
  std::vector<MapUpdate> updates = client.take_updates(place, visual::PublishedDetail::exact);
  std::sort(updates.begin(), updates.end(),
            [](const MapUpdate& a, const MapUpdate& b) { return a.nodes.front().id < b.nodes.front().id; });
  for (std::size_t i = 0; i < sessions.size(); ++i) {
    rig::RigMember member{name, updated({}, updates[i]), {}};
    member.map.id = updates[i].origin.map;
    for (const visual::PlacedFrame& frame : client.trajectory())
      if (frame.session == sessions[i])
        member.frames.push_back(
            {frame.stamp, compose(compose(robot_from_camera, frame.map_from_camera), inverse(robot_from_camera))});
    members.push_back(std::move(member));
  }
}

// back_yaw_rad: by which the second camera is turned against what its client believes.
inline DrivenRobot drive(double length_m, const Blindness& blindness = {}, double back_yaw_rad = 0.0) {
  WorkerPool here(1);
  const simulation::WorldOptions options = world_of_two_cameras(length_m);
  const simulation::World world(options, here);
  const simulation::FeatureOptions features;
  const simulation::LandmarkField field(world.scene(0), world.buildings()[0], features);
  DrivenRobot robot;
  simulation::Recording wheels(world, 0);
  for (auto step = wheels.next(); step; step = wheels.next()) {
    robot.odometry.push_back({step->stamp, spatial(step->odometry_from_robot)});
    robot.truth.push_back({step->stamp, spatial(step->world_from_robot)});
  }
  for (std::size_t c = 0; c < 2; ++c) {
    const simulation::FeatureRecording recording(world, field, features, 0, c);
    const auto& model = options.cameras[c].intrinsics();
    const std::string& name = options.cameras[c].id;
    Pose3 robot_from_camera = compose(inverse(world.world_from_robot(0, 0.0)), recording.frame(0).world_from_camera);
    if (c == 1) robot_from_camera.q = Eigen::AngleAxisd(back_yaw_rad, Eigen::Vector3d::UnitZ()) * robot_from_camera.q;
    visual::VisualClient client({model.width, model.height, model.fx, model.fy, model.cx, model.cy}, 0.0, {},
                                matching::shipped_vocabulary());
    for (std::size_t i = 0; i < recording.frame_count(); ++i) {
      const simulation::SimulatedFeatureFrame seen = recording.frame(i);
      visual::FeatureFrame frame = test::frame_of(seen);
      const double seconds = seconds_between(world.first_stamp(0), seen.stamp);
      if (name == blindness.camera && seconds >= blindness.begin_s && seconds < blindness.end_s) {
        frame.features = {};
        frame.inverse_depths.clear();
      }
      client.add(frame);
    }
    finish(client, name, robot_from_camera, robot.members);
  }
  return robot;
}

// A camera that closes no loop.
inline void forget(Map& map, double after_s) {
  for (auto& [id, landmark] : map.landmarks) {
    const Stamp anchored = map.nodes.find(landmark.anchor)->stamp;
    const auto is_later = [&](const LandmarkSighting& seen) {
      return std::abs(seconds_between(anchored, map.nodes.find(seen.node)->stamp)) > after_s;
    };
    landmark.seen.erase(std::remove_if(landmark.seen.begin(), landmark.seen.end(), is_later), landmark.seen.end());
  }
}

// The same camera without depth: its map has another scale, which changes by `drift` until the end. The camera's
// trajectory and landmarks are rescaled, its extrinsics are not.
inline rig::RigMember single(rig::RigMember member, double scale, double drift) {
  const Stamp first = member.frames.front().stamp;
  const double seconds = seconds_between(first, member.frames.back().stamp);
  const auto scale_at = [&](Stamp stamp) { return scale * (1.0 + drift * seconds_between(first, stamp) / seconds); };
  const Pose3 robot_from_camera = keyframe_of(member.map.nodes.front().second)->geometry->robot_from_camera;
  const auto camera_at = [&](const StampedPose& frame) { return compose(frame.map_from_robot, robot_from_camera); };
  std::vector<StampedPose> frames = member.frames;
  Pose3 camera = camera_at(frames.front());
  for (std::size_t i = 1; i < frames.size(); ++i) {
    Pose3 step = between(camera_at(member.frames[i - 1]), camera_at(member.frames[i]));
    step.t *= scale_at(frames[i].stamp);
    camera = compose(camera, step);
    frames[i].map_from_robot = compose(camera, inverse(robot_from_camera));
  }
  for (auto& [id, landmark] : member.map.landmarks) {
    const Eigen::Vector3d seen = landmark.point_in_anchor() - robot_from_camera.t;
    landmark.point_units =
        landmark_units(robot_from_camera.t + scale_at(member.map.nodes.find(landmark.anchor)->stamp) * seen);
    for (LandmarkSighting& sighting : landmark.seen) sighting.inverse_depth = 0;
  }
  forget(member.map, 8.0);
  for (auto& [id, node] : member.map.nodes) node.map_from_node = *pose_at(frames, node.stamp, 1.0);
  member.frames = frames;
  return member;
}

// Maps as a server has them: what clients sent, without frames.
inline std::vector<Map> maps_of(const std::vector<rig::RigMember>& members) {
  std::vector<Map> maps;
  for (const rig::RigMember& member : members) maps.push_back(member.map);
  return maps;
}

}  // namespace mapweave::test
