#pragma once
// Which keyframes of a map see the same landmarks.

#include <mapweave/maps/map.h>
#include <mapweave/maps/node_numbers.h>

#include <utility>
#include <vector>

namespace mapweave::fusion {

struct Covisibility {
  std::vector<const Node*> keyframes;  // by id
  // Of each keyframe: how many landmarks it shares, and with which one; most first.
  std::vector<std::vector<std::pair<std::size_t, std::size_t>>> shared;

  NodeNumbers numbers;

  std::size_t number_of(const NodeId& id) const { return numbers.of(id); }  // of a keyframe; keyframes.size() for another node
};
Covisibility covisibility(const Map&);

// Keyframes that see the same, for each the most (with at least so many landmarks), and one and the next of a session.
struct Step {
  const Node *from, *to;
  std::size_t shared;  // landmarks
};
std::vector<Step> steps(const Covisibility&, int least_shared);

// Whether its keyframes measured depth. Without that a map has the lengths that one camera gave it.
bool is_metric(const Map&);

}  // namespace mapweave::fusion
