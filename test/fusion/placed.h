#pragma once

#include <laser/wall_agreement.h>
#include <mapweave/matching/submap_model.h>
#include <support/simulated_maps.h>

#include <memory>
#include <vector>

namespace mapweave::fusion {

// The frozen submaps of a simulated robot whose map is the truth, laid where they are or moved.
class Placed {
 public:
  Placed(const simulation::SimulatedRobot& robot, const simulation::SimulatedLaserOptions& laser)
      : map_(test::mapped(robot, laser)) {
    for (const auto& [id, submap] : map_.submaps) {
      if (!submap.frozen) continue;
      models_.push_back(std::make_unique<matching::SubmapModel>(submap, map_.nodes));
      poses_.push_back(planar(map_.nodes.find(submap.anchor())->map_from_node));
    }
  }
  const std::vector<std::unique_ptr<matching::SubmapModel>>& models() const { return models_; }
  std::vector<PlacedSubmap> at(const Pose2& team_from_map, std::size_t first_number) const {
    std::vector<PlacedSubmap> placed;
    for (std::size_t i = 0; i < models_.size(); ++i) {
      const Pose2 pose = compose(team_from_map, poses_[i]);
      const Pose2 middle = compose(pose, Pose2{models_[i]->centre().x, models_[i]->centre().y, 0.0});
      placed.push_back({first_number + i, pose, middle.x, middle.y, models_[i]->radius_m(), &models_[i]->walls()});
    }
    return placed;
  }

 private:
  Map map_;
  std::vector<std::unique_ptr<matching::SubmapModel>> models_;
  std::vector<Pose2> poses_;
};

}  // namespace mapweave::fusion
