#pragma once
// Which frozen submaps of one robot show the same place, and what that makes of their poses.

#include <mapweave/graph/pose_graph.h>
#include <mapweave/laser/graph_options.h>
#include <mapweave/matching/model_cache.h>

#include <functional>
#include <set>
#include <utility>
#include <vector>

namespace mapweave::laser {

// Submaps this near in the sequence share scans, or nearly: matching them says nothing new.
inline constexpr std::size_t kSharing = 2;
// Two loops support each other up to so many submaps apart; farther, the path between them drifts too much to tell.
inline constexpr std::size_t kSupporting = 6;

class LaserLoopCloser {
 public:
  explicit LaserLoopCloser(const GraphMapperOptions& options);

  // A submap that was just frozen: looks for loops with all before it and, where some hold, moves the poses. `map`: in
  // the local frame.
  void add(const Submap& submap, const Map& map);
  // Looks once more at all pairs that lie near each other now, takes back loops that fold the map, and looks for loops
  // that end farther away than drift explains.
  void finish(const Map& map);

  const std::vector<Pose2>& map_from_submap() const { return poses_; }  // in the order of add()
  // Between the anchors; those that hold.
  std::vector<Constraint> loops() const;
  // How many were taken back because they lead the robot's path through walls.
  std::size_t folding_loops() const;

 private:
  enum class State { open, committed, folding };  // those that fold are not looked for again
  struct Loop {
    std::size_t a, b;  // numbers of submaps, a < b
    Judgement judgement;
    Pose2 a_from_b;
    Eigen::Matrix3d information;
    bool sure = false;  // found in a narrow window
    State state = State::open;
  };
  struct Uncertainty {
    double position_m, yaw_rad;
  };
  struct Kept {
    SubmapId id;
    NodeId anchor;
    Pose2 local_from_submap;
    double length_m;  // of the path to the next
    matching::Point2f centre;
    float radius_m;
    std::vector<matching::RingKey> keys;
  };
  struct Revisit {  // stretches of the path, by their first submaps, a < b
    std::size_t a, b;
    double yaw_rad;  // by which the heading may be off
  };
  using Stretch = std::function<const matching::SubmapView&(std::size_t first)>;
  enum class Found { nothing, loop, contradiction };
  using Pairs = std::set<std::pair<std::size_t, std::size_t>>;  // of submaps
  using Cluster = std::vector<std::size_t>;  // numbers of loops between the same two stretches of the path

  // The middles of the submaps' walls, in the map.
  std::vector<Eigen::Vector2d> centres_by(const std::vector<Pose2>& poses) const;
  matching::SubmapView view_of(std::size_t submap, const Map& map);
  // Of every submap as seen from `from`: along the path of least uncertainty through the graph.
  std::vector<Uncertainty> uncertainty_from(std::size_t from) const;
  bool is_known(std::size_t a, std::size_t b) const;  // whether there is a loop between them
  Judgement judged(std::size_t a, std::size_t b, const matching::WideWindow& window,
                   const matching::JudgeOptions& options, const Map& map);
  bool is_believed(const Judgement& judgement) const;
  static bool contradicts(const Judgement& judgement);
  static Loop loop_of(std::size_t a, std::size_t b, Judgement judgement);  // of its best hypothesis
  Found search(std::size_t a, std::size_t b, const Uncertainty& uncertainty, const Map& map);
  Found search(std::size_t a, std::size_t b, const matching::WideWindow& window, const Map& map);
  bool agree(const Loop& one, const Loop& other) const;
  void commit_agreeing();
  std::vector<graph::Edge> steps() const;  // of the path, from each submap to the next
  graph::Edge edge_of(const Loop& loop) const;
  void solve();
  // Searches pairs that lie near each other, in rounds. Returns by how many more of them hold than contradict, of those
  // that `before` has far from each other and that are not `counted` already.
  int look_near(const Map& map, const std::vector<Pose2>& before, const Pairs& counted = {});

  // loop_folds.cpp. True: some were taken back.
  bool take_back_folds(const Map& map);
  std::vector<Cluster> clusters() const;  // of committed loops, by when they were first closed
  bool folds(const std::vector<Pose2>& before, const std::vector<Pose2>& after, std::size_t last, const Map& map);

  // unexpected_loops.cpp. Leaves everything as it was where none is believed.
  void close_unexpected(const Map& map);
  matching::SubmapView stretch_from(std::size_t first, const Map& map) const;
  std::vector<Revisit> possible_revisits(std::size_t b) const;
  std::vector<Revisit> alike(const Stretch& stretch) const;
  matching::WideWindow window_of(const Revisit& revisit, const Stretch& stretch) const;
  std::vector<Loop> proposed_loops(const Stretch& stretch) const;
  bool closes(const Loop& proposed, const Map& map);
  void search_beside(const Loop& loop, const Map& map, Pairs& contradicting);

  GraphMapperOptions options_;
  matching::ModelCache cache_;
  std::vector<Kept> submaps_;
  std::vector<Pose2> poses_;
  std::vector<Loop> loops_;
};

}  // namespace mapweave::laser
