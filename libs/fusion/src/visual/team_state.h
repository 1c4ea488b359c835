#pragma once
// A team of maps of keyframes while it is put together: keyframes and landmarks of all members in a row, by numbers.

#include "visual_team.h"

#include <mapweave/core/disjoint_sets.h>
#include <mapweave/graph/bundle_adjustment.h>

#include <vector>

namespace mapweave::fusion {

struct TeamKeyframe {
  std::size_t member = 0;
  const MappedKeyframe* content = nullptr;
  std::size_t first_landmark = 0;  // number in the team of its map's first
  double depth_m = 1.0;            // middle one of what it sees
  Pose3 team_from_node;
  Pose3 team_from_camera() const { return compose(team_from_node, content->content->geometry->robot_from_camera); }
};

struct SharedSighting {
  std::size_t keyframe, feature, landmark;  // numbers in the team
};

// Where a robot's laser has one of its keyframes, and how surely.
struct HeldKeyframe {
  std::size_t keyframe;  // number in the team
  Pose3 team_from_camera;
  double sigma_m, sigma_rad;
};

struct TeamState {
  // All outlive it. team_from_map: where the members lie, about.
  TeamState(const std::vector<const VisualMap*>& its_members, const std::vector<VisualJoin>& its_joins,
            const std::vector<Sim3>& where);

  double scale_of(std::size_t member) const { return team_from_map[member].scale; }
  MetricWitness in_team(const VisualJoin& join, const VisualWitness& w) const {
    return rescaled(w, *members[join.a], *members[join.b], scale_of(join.a), scale_of(join.b));
  }
  // Whether they are of two cameras of one rig: the last keyframe of one and the first of the other say nothing of
  // each other.
  bool are_of_one_rig(std::size_t a, std::size_t b) const;
  // Where the keyframes have them that they are anchored in.
  void place_landmarks();
  // Landmarks that are one, as the sightings say.
  DisjointSets classes(const std::vector<SharedSighting>& found) const;

  const std::vector<const VisualMap*>& members;
  const std::vector<VisualJoin>& joins;
  const std::vector<Sim3>& team_from_map;
  std::vector<std::size_t> first_keyframe;  // of each member
  std::vector<TeamKeyframe> keyframes;
  std::vector<char> is_free;       // of each: the bundle moves it
  std::vector<HeldKeyframe> held;  // by number; where there are any, they hold the frame
  std::vector<LandmarkId> landmark_ids;
  std::vector<std::size_t> landmark_member, landmark_keyframe;  // whose each is; where it hangs
  std::vector<Eigen::Vector3d> points;                          // in the team's frame
  std::vector<std::vector<const Constraint*>> rigs;             // of each member
};

}  // namespace mapweave::fusion
