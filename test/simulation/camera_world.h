#pragma once
// A small world with a camera, for tests.

#include <mapweave/simulation/world.h>

namespace mapweave::test {

inline simulation::CameraOptions tiny_camera(simulation::SimulatedCameraKind kind) {
  simulation::CameraOptions camera;
  camera.kind = kind;
  camera.width = 160;
  camera.height = 120;
  camera.fx = camera.fy = 131.0;
  camera.frames_per_second = 10.0;
  return camera;
}

inline simulation::CameraOptions perfect(simulation::CameraOptions camera) {
  camera.image = {0.0, 0.0, 0.0, 0.0};
  camera.depth.noise_m = camera.depth.noise_per_m2 = camera.depth.step_per_m2 = camera.depth.shadow_m =
      camera.depth.dropouts = 0.0;
  camera.depth.min_range_m = 0.0;
  camera.depth.max_range_m = 13.0;
  camera.depth.grazing_deg = 90.0;
  return camera;
}

// One robot, "alpha", that drives 3 m along a corridor of 6 m.
inline simulation::WorldOptions camera_world(const simulation::CameraOptions& camera) {
  simulation::WorldOptions options;
  options.seed = 3;
  options.buildings.resize(1);
  options.buildings[0].kind = simulation::PlanKind::corridor;
  options.buildings[0].corridor = {6.0, 2.0, 2, 0};
  options.cameras = {camera};
  options.robots.resize(1);
  options.robots[0].id = "alpha";
  options.robots[0].waypoints = {{1.0, 1.0}, {4.0, 1.0}};
  options.robots[0].return_to_start = false;
  return options;
}

inline simulation::World built(const simulation::WorldOptions& options) {
  WorkerPool here(1);
  return simulation::World(options, here);
}

}  // namespace mapweave::test
