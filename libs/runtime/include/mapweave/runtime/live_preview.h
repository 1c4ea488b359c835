#pragma once
// The maps so far, for pages and topics that show them.

#include <mapweave/fusion/compose_grid.h>
#include <mapweave/fusion/fuse.h>

#include <nlohmann/json_fwd.hpp>

#include <cstdint>
#include <map>
#include <memory>
#include <string>
#include <vector>

namespace mapweave::tiers {
class RoundMerger;
}

namespace mapweave::runtime {

struct LivePreview {
  struct JointMap {
    std::vector<MapId> members;  // maps that are merged in this part
    Map map;                     // holds nodes and constraints only
    // How robots' own maps (LiveEdge::map_so_far) lie in it, by where each robot stood first there: such that its
    // newest pose in both is where it is here.
    std::map<RobotId, Pose3> part_from_start;
  };
  std::uint64_t number = 0;     // counts previews from 1
  std::vector<JointMap> parts;  // largest part first
};

// A preview of the last fuse().
std::shared_ptr<const LivePreview> preview_of(const tiers::RoundMerger&, std::uint64_t number);

// When the newest scan of each robot in the last fuse() was sensed. Scans that showed nothing new are not among them.
std::map<RobotId, Stamp> newest_scans(const tiers::RoundMerger&);

// As the live page draws it: {number, maps: [report::live_map()]}. Of large maps not every scan is drawn, and in larger
// cells, so that it takes a second or two and not more. robots: as report::live_page() has them.
nlohmann::ordered_json preview_json(const LivePreview&, const std::vector<std::string>& robots,
                                    const fusion::ComposeOptions&);

}  // namespace mapweave::runtime
