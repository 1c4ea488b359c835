#pragma once
// One pose graph of one robot's laser and cameras. Keyframes and laser nodes are constrained to each other by time, so
// that a loop closure of a camera corrects the grid, and an alignment of walls corrects keyframes.

#include <mapweave/graph/pose_graph.h>
#include <mapweave/maps/map.h>
#include <mapweave/maps/map_noise.h>

#include <vector>

namespace mapweave::rig {

struct LaserCameraOptions {
  double longest_gap_s = 1.0;
  double extrinsic_sigma_m = 0.02, extrinsic_sigma_rad = 0.01;
  // Softer than in a rig (maps/map_noise.h): here the laser gives the shape, and cameras follow.
  double covisibility_sigma_m = 0.02, covisibility_sigma_per_m = 0.02, covisibility_sigma_rad = 0.012;
  int least_shared = kCovisibleMotion.least_shared;
  template <class Visitor>
  void describe(Visitor& v) {
    v.positive("longest_gap_s", longest_gap_s,
               "longest time in seconds between the two scans around a keyframe for the keyframe to be constrained to "
               "the laser's trajectory; larger values make more constraints, with larger errors");
    v.positive(
        "extrinsic_sigma_m", extrinsic_sigma_m,
        "standard deviation in metres between a keyframe and the laser's interpolated pose at its time: errors of "
        "extrinsics, stamps and interpolation; larger values let the camera map move against the laser map more");
    v.positive("extrinsic_sigma_rad", extrinsic_sigma_rad,
               "standard deviation in radians between the heading of a keyframe and of the laser's interpolated pose "
               "at its time; larger values let the camera map turn against the laser map more");
    v.positive(
        "covisibility_sigma_m", covisibility_sigma_m,
        "standard deviation in metres of the motion between two covisible keyframes in the joint graph of laser "
        "and cameras; by default more than rig.covisibility_sigma_m, since here the laser gives the shape and cameras "
        "follow; larger values let the laser bend the camera map more");
    v.non_negative("covisibility_sigma_per_m", covisibility_sigma_per_m,
                   "standard deviation of the motion between two covisible keyframes in metres per metre of it, added "
                   "to covisibility_sigma_m, in the joint graph of laser and cameras; larger values let the laser bend "
                   "the camera map more");
    v.positive("covisibility_sigma_rad", covisibility_sigma_rad,
               "standard deviation in radians of the rotation between two covisible keyframes in the joint graph of "
               "laser and cameras; larger values let the laser bend the camera map more");
    v.integer("least_shared", least_shared, 1, 100000,
              "least number of landmarks that two keyframes must share to be constrained to each other in the joint "
              "graph of laser and cameras; larger values make fewer constraints and let the camera map bend more");
  }
};

// The laser's map with the keyframes and landmarks of the camera maps, solved.
struct LaserCameraMap {
  Map map;                   // id: the laser map's; its first node does not move
  std::vector<MapId> apart;  // camera maps that are not in it: no scan was taken around their time
};
// All maps are of one robot.
LaserCameraMap align_cameras(Map laser, const std::vector<Map>& cameras, const LaserCameraOptions& options = {},
                             const graph::SolveOptions& solve = {});

// Constraints between covisible keyframes, from their poses in the map, which is metric. In the plane.
std::vector<Constraint> covisibility_constraints(const Map&, const LaserCameraOptions&);

}  // namespace mapweave::rig
