#pragma once
// What maps look like once they are merged, ready to be asked: where a client is in it, what it may see there, where a
// picture was taken.

#include <mapweave/fusion/fuse.h>
#include <mapweave/fusion/place_finder.h>
#include <mapweave/matching/landmark_description.h>

#include <deque>
#include <memory>
#include <mutex>
#include <optional>

namespace mapweave::tiers {

class TeamView {
 public:
  // How landmarks are found and described, and which of them those who made them have no longer (ascending).
  struct Making {
    matching::LandmarkIndexOptions index;
    matching::DescriptionOptions description;
    std::shared_ptr<fusion::BagOfWordsCache> pictures;
    std::vector<LandmarkId> forgotten;
  };
  // `input`: what was merged to `result`.
  TeamView(fusion::FusionResult result, const std::vector<Map>& input, Making making, WorkerPool& pool);
  TeamView(const TeamView&) = delete;
  TeamView& operator=(const TeamView&) = delete;

  // What is asked seldom is made when it is asked for the first time. All calls are thread-safe.
  class Component {
   public:
    Component(const fusion::Component& content, const Making& making);
    const fusion::Component& content() const { return content_; }
    void make_landmarks(WorkerPool& pool) const;
    const matching::LandmarkIndex& landmarks() const;  // in the team's frame
    // Of those, what the clients that made it have forgotten; null where that is nothing.
    void make_forgotten(WorkerPool& pool);
    const matching::LandmarkIndex* forgotten() const { return forgotten_ ? &*forgotten_ : nullptr; }
    // Of the landmarks, those that hang on a keyframe; by id.
    const std::vector<LandmarkId>& landmarks_of(const NodeId& keyframe) const;
    const fusion::PlaceFinder& places(const matching::ChosenVocabulary& vocabulary, WorkerPool& pool) const;

   private:
    const fusion::Component& content_;
    const Making& making_;
    mutable std::once_flag has_landmarks_, has_places_, has_anchored_;
    mutable std::optional<matching::LandmarkIndex> landmarks_;
    std::optional<matching::LandmarkIndex> forgotten_;
    mutable std::optional<fusion::PlaceFinder> places_;
    mutable std::map<NodeId, std::vector<LandmarkId>> anchored_;
  };
  const std::deque<Component>& components() const { return components_; }
  const fusion::FusionResult& result() const { return result_; }

  // Where a client's map lies in the team.
  struct Member {
    const Component* component;
    double scale = 1.0;              // of the team, in units of the map
    Table<NodeId, Pose3> published;  // of its nodes, as its client said when the merge began
    struct Placed {
      NodeId id;
      Eigen::Vector3d in_map, in_team;
    };
    std::vector<Placed> nodes;  // of those that the team has
  };
  const Member* member(const MapId& map) const;
  const std::map<MapId, Member>& members() const { return members_; }

 private:
  fusion::FusionResult result_;
  const Making making_;
  std::deque<Component> components_;
  std::map<MapId, Member> members_;
};

// The map's frame in the team's around one of its keyframes: maps bend, so a single transform holds for a part of it
// alone. Of the camera and of what it sees: the robot under it does not grow with its map's scale.
Sim3 team_from_map_at(const NodeId& node, const Pose3& map_from_node, const TeamView::Member& member);

}  // namespace mapweave::tiers
