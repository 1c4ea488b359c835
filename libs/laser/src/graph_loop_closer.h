#pragma once
// Which frozen submaps of one robot show the same place, and what that makes of their poses.

#include <mapweave/graph/pose_graph.h>
#include <mapweave/laser/graph_options.h>
#include <mapweave/matching/model_cache.h>

#include <utility>
#include <vector>

namespace mapweave::laser {

class LaserLoopCloser {
 public:
  explicit LaserLoopCloser(const GraphMapperOptions& options);

  // A submap that was just frozen: looks for loops with all before it and, where some hold, moves the poses. `map`: in
  // the local frame.
  void add(const Submap& submap, const Map& map);
  // Looks once more at all pairs that lie near each other now.
  void finish(const Map& map);

  const std::vector<Pose2>& map_from_submap() const { return poses_; }  // in the order of add()
  // Between the anchors; those that hold.
  std::vector<Constraint> loops() const;

 private:
  struct Loop {
    std::size_t a, b;  // numbers of submaps, a < b
    Judgement judgement;
    Pose2 a_from_b;
    Eigen::Matrix3d information;
    bool sure = false;  // found in a narrow window
    bool committed = false;
  };
  struct Uncertainty {
    double position_m, yaw_rad;
  };
  std::pair<double, double> centre_of(std::size_t submap) const;  // in the map
  // Of every submap as seen from `from`: along the path of least uncertainty through the graph.
  std::vector<Uncertainty> uncertainty_from(std::size_t from) const;
  bool search(std::size_t a, std::size_t b, const Uncertainty& uncertainty, const Map& map);
  void commit_agreeing();
  void solve();

  GraphMapperOptions options_;
  matching::ModelCache cache_;
  struct Kept {
    SubmapId id;
    NodeId anchor;
    Pose2 local_from_submap;
    double length_m;  // of the path to the next
    matching::Point2f centre;
    float radius_m;
    std::vector<matching::RingKey> keys;
  };
  std::vector<Kept> submaps_;
  std::vector<Pose2> poses_;
  std::vector<Loop> loops_;
};

}  // namespace mapweave::laser
