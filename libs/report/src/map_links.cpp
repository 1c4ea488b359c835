#include "map_links.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace mapweave::report {
namespace {

// Evenly picked ones of `links`.
Json picked(const std::vector<Json>& links, std::size_t most) {
  Json json = Json::array();
  const std::size_t count = std::min(links.size(), most);
  for (std::size_t i = 0; i < count; ++i) json.push_back(links[i * links.size() / count]);
  return json;
}

}  // namespace

Json links_json(const Map& graph, std::size_t most) {
  std::vector<Json> loops, joins;
  for (const auto& [key, constraint] : graph.constraints) {
    const ConstraintId& id = constraint.id;
    const Node *from = graph.nodes.find(id.from), *to = graph.nodes.find(id.to);
    const bool is_of_two = id.from.session.client.robot != id.to.session.client.robot;
    if (from == nullptr || to == nullptr || !(is_of_two || id.kind == ConstraintKind::loop)) continue;
    const auto centimetres = [](double metres) { return std::llround(100.0 * metres); };
    const Eigen::Vector3d &a = from->map_from_node.t, &b = to->map_from_node.t;
    (is_of_two ? joins : loops)
        .push_back({centimetres(a.x()), centimetres(a.y()), centimetres(b.x()), centimetres(b.y())});
  }
  return {{"has_links", true},
          {"loops", picked(loops, most)},
          {"loop_count", loops.size()},
          {"joins", picked(joins, most)},
          {"join_count", joins.size()}};
}

}  // namespace mapweave::report
