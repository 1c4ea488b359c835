#pragma once
// Which keyframes of a map see the same landmarks.

#include <mapweave/maps/map.h>
#include <mapweave/maps/node_numbers.h>

#include <utility>
#include <vector>

namespace mapweave::rig {

struct Covisibility {
  std::vector<const Node*> keyframes;  // by id
  // For each keyframe: how many landmarks it shares with another one, and the other's number. Most landmarks first.
  std::vector<std::vector<std::pair<std::size_t, std::size_t>>> shared;

  NodeNumbers numbers;

  std::size_t number_of(const NodeId& id) const {
    return numbers.of(id);
  }  // of a keyframe; keyframes.size() for another node
};
Covisibility covisibility(const Map&);

struct CovisibilityEdge {
  const Node *from, *to;
  std::size_t shared;  // landmarks
};
// Each keyframe and those before it with which it shares most landmarks (at least `least_shared`), and consecutive
// keyframes of a session.
std::vector<CovisibilityEdge> covisibility_edges(const Covisibility&, int least_shared);

}  // namespace mapweave::rig
