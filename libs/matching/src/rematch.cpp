#include <mapweave/matching/rematch.h>
#include <mapweave/matching/scan_matcher.h>

#include <algorithm>
#include <map>
#include <optional>

namespace mapweave::matching {
namespace {

constexpr std::size_t kPoints = 180;  // as laser.graph.front_end.most_points

WallField field_of(const Submap& submap, const Table<NodeId, Node>& nodes) {
  WallField field;
  for (const auto& [id, pose] : submap.submap_from_node)
    if (const auto* scan = std::get_if<PackedScan>(nodes.find(id)->payload.get()))
      field.add(placed(planar(pose), wall_points(*scan, 0.0, kFarthestWall_m)));
  field.settle();
  return field;
}

// Which submaps come near where, under the map's present belief.
class NearSubmaps {
 public:
  NearSubmaps(const Map& map, double radius_m) : inverse_(1.0 / radius_m), radius_m_(radius_m) {
    for (const auto& [id, submap] : map.submaps)
      if (submap.frozen) submaps_.push_back(&submap);
    paths_.resize(submaps_.size());
    for (std::size_t i = 0; i < submaps_.size(); ++i)
      for (const auto& [id, pose] : submaps_[i]->submap_from_node) {
        const Pose2 here = planar(map.nodes.find(id)->map_from_node);
        if (paths_[i].empty() || std::hypot(here.x - paths_[i].back().x, here.y - paths_[i].back().y) > 0.5)
          paths_[i].push_back(here);
      }
    for (std::size_t i = 0; i < submaps_.size(); ++i)
      for (const auto& p : paths_[i]) {
        auto& list = blocks_[{cell_of(p.x, inverse_), cell_of(p.y, inverse_)}];
        if (list.empty() || list.back() != i) list.push_back(static_cast<std::uint32_t>(i));
      }
  }
  const std::vector<const Submap*>& submaps() const { return submaps_; }
  // Those that the node is not part of, nearest first.
  std::vector<std::uint32_t> around(const NodeId& id, const Node& node) const {
    const Pose2 here = planar(node.map_from_node);
    std::vector<std::pair<double, std::uint32_t>> candidates;
    for (const auto index : in_blocks_around(here)) {
      const auto& members = submaps_[index]->submap_from_node;
      if (std::binary_search(members.begin(), members.end(), std::make_pair(id, Pose3{}),
                             [](const auto& l, const auto& r) { return l.first < r.first; }))
        continue;
      double distance = 1e300;
      for (const auto& p : paths_[index]) distance = std::min(distance, std::hypot(p.x - here.x, p.y - here.y));
      if (distance <= radius_m_) candidates.emplace_back(distance, index);
    }
    std::sort(candidates.begin(), candidates.end());
    std::vector<std::uint32_t> result;
    for (const auto& candidate : candidates) result.push_back(candidate.second);
    return result;
  }

 private:
  std::vector<std::uint32_t> in_blocks_around(const Pose2& here) const {
    const int cx = cell_of(here.x, inverse_), cy = cell_of(here.y, inverse_);
    std::vector<std::uint32_t> around;
    for (int j = -1; j <= 1; ++j)
      for (int i = -1; i <= 1; ++i) {
        const auto found = blocks_.find({cx + i, cy + j});
        if (found != blocks_.end()) around.insert(around.end(), found->second.begin(), found->second.end());
      }
    std::sort(around.begin(), around.end());
    around.erase(std::unique(around.begin(), around.end()), around.end());
    return around;
  }

  double inverse_, radius_m_;
  std::vector<const Submap*> submaps_;
  std::vector<std::vector<Pose2>> paths_;  // of each submap, every half metre
  std::map<std::pair<int, int>, std::vector<std::uint32_t>> blocks_;
};

// Of each submap, the nodes whose scans are to be matched to it.
std::vector<std::vector<const Node*>> questions(const Map& map, const NearSubmaps& near, int most_submaps,
                                                const std::function<bool(const NodeId&, const Submap&)>& is_left_out) {
  std::vector<std::vector<const Node*>> asked(near.submaps().size());
  for (const auto& [id, node] : map.nodes) {
    if (!node.payload || !std::holds_alternative<PackedScan>(*node.payload)) continue;
    std::vector<std::uint32_t> around = near.around(id, node);
    if (around.size() > static_cast<std::size_t>(most_submaps)) around.resize(static_cast<std::size_t>(most_submaps));
    int left = is_left_out ? (most_submaps + 1) / 2 : most_submaps;
    for (const std::uint32_t submap : around) {
      if (left == 0) break;
      if (is_left_out && is_left_out(node.id, *near.submaps()[submap])) continue;
      asked[submap].push_back(&node);
      --left;
    }
  }
  return asked;
}

// Matches scans to one submap.
class SubmapMatcher {
 public:
  // All outlive it. `number`: of the submap, for the names of constraints.
  SubmapMatcher(const Map& map, const Submap& submap, std::uint32_t number, const RematchOptions& options,
                ModelCache* models)
      : submap_(submap), number_(number), options_(options) {
    model_ = models != nullptr ? models->find(submap.content) : nullptr;
    if (model_ != nullptr && model_->is_raster()) model_ = nullptr;  // scans are matched to scans
    if (model_ != nullptr) {
      likelihood_ = model_->field().likelihood().dense();
    } else {
      const WallField field = field_of(submap, map.nodes);
      likelihood_ = field.likelihood();
      made_ = SparseWallField(field);
    }
    members_.reserve(submap.submap_from_node.size());
    for (const auto& [id, pose] : submap.submap_from_node)
      members_.push_back({planar(map.nodes.find(id)->map_from_node), planar(pose)});
  }
  std::optional<Constraint> match(const Node& node) const {
    const auto& scan = std::get<PackedScan>(*node.payload);
    const auto all = wall_points(scan, 0.0, kFarthestWall_m);
    const auto points = scan.geometry->has_sweep() ? thinned_evenly(all, 0.05, kPoints) : thinned(all, 0.05, kPoints);
    if (points.size() < 20) return std::nullopt;
    // From the submap's member nearest to the node, not from its anchor: belief may bend a submap that is frozen
    // straight.
    const Pose2 here = planar(node.map_from_node);
    const Member& near_node = members_[nearest_to(here, &Member::map_from_node)];
    const Pose2 expected = compose(near_node.submap_from_node, between(near_node.map_from_node, here));
    const auto coarse = correlate(likelihood_, points, expected, {0.15, 0.018, 0.006}, {0.2, 0.05});
    if (!coarse) return std::nullopt;
    const ScanMatch match =
        refine(model_ != nullptr ? model_->field() : made_, points, coarse->field_from_scan, {}, nullptr, 15);
    const Pose2 correction = between(expected, match.field_from_scan);
    if (match.inliers < options_.min_inliers || std::hypot(correction.x, correction.y) > options_.max_correction_m ||
        std::abs(correction.phi) > options_.max_correction_rad)
      return std::nullopt;
    return constraint_of(match, node);
  }

 private:
  struct Member {
    Pose2 map_from_node, submap_from_node;
  };
  std::size_t nearest_to(const Pose2& pose, Pose2 Member::*frame) const {
    std::size_t nearest = 0;
    double best = 1e300;
    for (std::size_t k = 0; k < members_.size(); ++k) {
      const double dx = (members_[k].*frame).x - pose.x, dy = (members_[k].*frame).y - pose.y;
      if (dx * dx + dy * dy < best) {
        best = dx * dx + dy * dy;
        nearest = k;
      }
    }
    return nearest;
  }
  // Constrains the node to the member nearest to where it was found, as belief may bend the submap.
  Constraint constraint_of(const ScanMatch& match, const Node& node) const {
    const std::size_t nearest = nearest_to(match.field_from_scan, &Member::submap_from_node);
    const NodeId& member_id = submap_.submap_from_node[nearest].first;
    Eigen::Matrix3d information = options_.information_scale * match.information;
    const Eigen::Matrix3d floor = Eigen::Vector3d(1e-4, 1e-4, 4e-6).asDiagonal();  // 1 cm, 0.11 degrees
    information = (Eigen::Matrix3d::Identity() + information * floor).inverse() * information;
    const bool own = member_id.session == node.id.session;
    return planar_constraint(
        {own ? ConstraintKind::scan_match : ConstraintKind::between_maps, member_id, node.id, 1 + number_},
        between(members_[nearest].submap_from_node, match.field_from_scan),
        0.5 * (information + information.transpose()));
  }

  const Submap& submap_;
  std::uint32_t number_;
  const RematchOptions& options_;
  std::shared_ptr<const SubmapModel> model_;  // null: the field is made
  SparseWallField made_;
  Raster<std::uint8_t> likelihood_;  // of the field
  std::vector<Member> members_;
};

}  // namespace

std::vector<Constraint> rematch(const Map& map, const RematchOptions& options, WorkerPool& pool,
                                const std::function<bool(const NodeId&, const Submap&)>& is_left_out,
                                ModelCache* models) {
  if (options.most_submaps == 0) return {};
  const NearSubmaps near(map, options.radius_m);
  const auto asked = questions(map, near, options.most_submaps, is_left_out);
  auto found = pool.map(asked.size(), [&](std::size_t i) {
    std::vector<Constraint> constraints;
    if (asked[i].empty()) return constraints;
    const SubmapMatcher matcher(map, *near.submaps()[i], static_cast<std::uint32_t>(i), options, models);
    for (const Node* node : asked[i])
      if (auto constraint = matcher.match(*node)) constraints.push_back(std::move(*constraint));
    return constraints;
  });
  std::vector<Constraint> all;
  std::size_t count = 0;
  for (const auto& part : found) count += part.size();
  all.reserve(count);
  for (auto& part : found) {
    all.insert(all.end(), part.begin(), part.end());
    part = {};  // memory for one of each, not for two
  }
  return all;
}

}  // namespace mapweave::matching
