#pragma once
// Which landmarks hang on each node of a map. Kept beside a map that grows, so that a node can go without a look
// through all of them.

#include <mapweave/maps/landmark.h>

#include <map>
#include <vector>

namespace mapweave {

// Four bytes for each time that a landmark is anchored in, or seen by, a node.
class LandmarksByNode {
 public:
  void add(const NodeId& node, const LandmarkId& landmark);  // nothing where it is known
  void remove(const NodeId& node, const LandmarkId& landmark);
  std::vector<LandmarkId> at(const NodeId& node) const;  // ascending

 private:
  using Indices = std::vector<std::uint32_t>;  // ascending
  std::map<NodeId, std::map<SessionId, Indices>> landmarks_;
};

}  // namespace mapweave
