#include <mapweave/matching/rematch.h>
#include <mapweave/matching/scan_matcher.h>

#include <algorithm>
#include <map>

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

}  // namespace

std::vector<Constraint> rematch(const Map& map, const RematchOptions& options, WorkerPool& pool,
                                const std::function<bool(const NodeId&, const Submap&)>& is_left_out,
                                ModelCache* models) {
  if (options.most_submaps == 0) return {};
  std::vector<const Submap*> submaps;
  for (const auto& [id, submap] : map.submaps)
    if (submap.frozen) submaps.push_back(&submap);
  // Where each submap's path runs under the present belief, every metre or so.
  std::vector<std::vector<Pose2>> paths(submaps.size());
  for (std::size_t i = 0; i < submaps.size(); ++i)
    for (const auto& [id, pose] : submaps[i]->submap_from_node) {
      const Pose2 here = planar(map.nodes.find(id)->map_from_node);
      if (paths[i].empty() || std::hypot(here.x - paths[i].back().x, here.y - paths[i].back().y) > 0.5)
        paths[i].push_back(here);
    }
  // A coarse raster of which submaps come near where.
  std::map<std::pair<int, int>, std::vector<std::uint32_t>> near;
  const double inverse = 1.0 / options.radius_m;
  for (std::size_t i = 0; i < submaps.size(); ++i)
    for (const auto& p : paths[i]) {
      auto& list = near[{cell_of(p.x, inverse), cell_of(p.y, inverse)}];
      if (list.empty() || list.back() != i) list.push_back(static_cast<std::uint32_t>(i));
    }
  // Which nodes each submap is to be asked about.
  std::vector<std::vector<const Node*>> asked(submaps.size());
  for (const auto& [id, node] : map.nodes) {
    if (!node.payload || !std::holds_alternative<PackedScan>(*node.payload)) continue;
    const Pose2 here = planar(node.map_from_node);
    const int cx = cell_of(here.x, inverse), cy = cell_of(here.y, inverse);
    std::vector<std::pair<double, std::uint32_t>> candidates;
    std::vector<std::uint32_t> around;
    for (int j = -1; j <= 1; ++j)
      for (int i = -1; i <= 1; ++i) {
        const auto found = near.find({cx + i, cy + j});
        if (found != near.end()) around.insert(around.end(), found->second.begin(), found->second.end());
      }
    std::sort(around.begin(), around.end());
    around.erase(std::unique(around.begin(), around.end()), around.end());
    for (const auto index : around) {
      const auto& members = submaps[index]->submap_from_node;
      if (std::binary_search(members.begin(), members.end(), std::make_pair(id, Pose3{}),
                             [](const auto& l, const auto& r) { return l.first < r.first; }))
        continue;
      double distance = 1e300;
      for (const auto& p : paths[index]) distance = std::min(distance, std::hypot(p.x - here.x, p.y - here.y));
      if (distance <= options.radius_m) candidates.emplace_back(distance, index);
    }
    std::sort(candidates.begin(), candidates.end());
    if (candidates.size() > static_cast<std::size_t>(options.most_submaps))
      candidates.resize(static_cast<std::size_t>(options.most_submaps));
    int left = is_left_out ? (options.most_submaps + 1) / 2 : options.most_submaps;
    for (const auto& candidate : candidates) {
      if (left == 0) break;
      if (is_left_out && is_left_out(node.id, *submaps[candidate.second])) continue;
      asked[candidate.second].push_back(&node);
      --left;
    }
  }

  auto found = pool.map(submaps.size(), [&](std::size_t i) {
    std::vector<Constraint> constraints;
    if (asked[i].empty()) return constraints;
    const Submap& submap = *submaps[i];
    auto model = models != nullptr ? models->find(submap.content) : nullptr;
    if (model != nullptr && model->is_raster()) model = nullptr;  // scans are matched to scans
    const WallField made = model == nullptr ? field_of(submap, map.nodes) : WallField();
    const WallField& field = model == nullptr ? made : model->field();
    struct Member {
      Pose2 map_from_node, submap_from_node;
    };
    std::vector<Member> members;
    members.reserve(submap.submap_from_node.size());
    for (const auto& [id, pose] : submap.submap_from_node)
      members.push_back({planar(map.nodes.find(id)->map_from_node), planar(pose)});
    const auto nearest_to = [&](const Pose2& pose, Pose2 Member::*frame) {
      std::size_t nearest = 0;
      double best = 1e300;
      for (std::size_t k = 0; k < members.size(); ++k) {
        const double dx = (members[k].*frame).x - pose.x, dy = (members[k].*frame).y - pose.y;
        if (dx * dx + dy * dy < best) best = dx * dx + dy * dy, nearest = k;
      }
      return nearest;
    };
    for (const Node* node : asked[i]) {
      const auto& scan = std::get<PackedScan>(*node->payload);
      const auto all = wall_points(scan, 0.0, kFarthestWall_m);
      const auto points = scan.geometry->has_sweep() ? thinned_evenly(all, 0.05, kPoints) : thinned(all, 0.05, kPoints);
      if (points.size() < 20) continue;
      // From the submap's member nearest to the node, not from its anchor: belief may bend a submap that is frozen
      // straight.
      const Pose2 here = planar(node->map_from_node);
      const Member& near_node = members[nearest_to(here, &Member::map_from_node)];
      const Pose2 expected = compose(near_node.submap_from_node, between(near_node.map_from_node, here));
      const auto coarse = correlate(field, points, expected, {0.15, 0.018, 0.006}, {0.2, 0.05});
      if (!coarse) continue;
      const ScanMatch match = refine(field, points, coarse->field_from_scan, {}, nullptr, 15);
      const Pose2 correction = between(expected, match.field_from_scan);
      if (match.inliers < options.min_inliers || std::hypot(correction.x, correction.y) > options.max_correction_m ||
          std::abs(correction.phi) > options.max_correction_rad)
        continue;
      // Tie the node to the nearest member, for the same reason.
      const std::size_t nearest = nearest_to(match.field_from_scan, &Member::submap_from_node);
      const NodeId& member_id = submap.submap_from_node[nearest].first;
      Eigen::Matrix3d information = options.information_scale * match.information;
      const Eigen::Matrix3d floor = Eigen::Vector3d(1e-4, 1e-4, 4e-6).asDiagonal();  // 1 cm, 0.11 degrees
      information = (Eigen::Matrix3d::Identity() + information * floor).inverse() * information;
      const bool own = member_id.session == node->id.session;
      constraints.push_back(planar_constraint({own ? ConstraintKind::scan_match : ConstraintKind::between_maps,
                                               member_id, node->id, 1 + static_cast<std::uint32_t>(i)},
                                              between(members[nearest].submap_from_node, match.field_from_scan),
                                              0.5 * (information + information.transpose())));
    }
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
