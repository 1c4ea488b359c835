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
  // `input`: what was merged to `result`.
  TeamView(fusion::FusionResult result, const std::vector<Map>& input, const matching::LandmarkIndexOptions& index,
           const matching::DescriptionOptions& description, std::shared_ptr<fusion::BagOfWordsCache> pictures,
           WorkerPool& pool);

  // What is asked seldom is made when it is asked for the first time. All calls are thread-safe.
  class Component {
   public:
    Component(const fusion::Component& content, const matching::LandmarkIndexOptions& index,
              const matching::DescriptionOptions& description, std::shared_ptr<fusion::BagOfWordsCache> pictures);
    const fusion::Component& content() const { return content_; }
    void make_landmarks(WorkerPool& pool) const;
    const matching::LandmarkIndex& landmarks() const;  // in the team's frame
    const fusion::PlaceFinder& places(const matching::ChosenVocabulary& vocabulary, WorkerPool& pool) const;

   private:
    const fusion::Component& content_;
    const matching::LandmarkIndexOptions index_;
    const matching::DescriptionOptions description_;
    const std::shared_ptr<fusion::BagOfWordsCache> pictures_;
    mutable std::once_flag has_landmarks_, has_places_;
    mutable std::optional<matching::LandmarkIndex> landmarks_;
    mutable std::optional<fusion::PlaceFinder> places_;
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

 private:
  fusion::FusionResult result_;
  std::deque<Component> components_;
  std::map<MapId, Member> members_;
};

// The map's frame in the team's around one of its keyframes: maps bend, so a single transform holds for a part of it
// alone. Of the camera and of what it sees: the robot under it does not grow with its map's scale.
Sim3 team_from_map_at(const NodeId& node, const Pose3& map_from_node, const TeamView::Member& member);

}  // namespace mapweave::tiers
