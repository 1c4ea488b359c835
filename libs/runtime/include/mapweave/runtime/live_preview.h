#pragma once
// The maps so far, for who looks.

#include <mapweave/fusion/compose_grid.h>
#include <mapweave/fusion/fuse.h>

#include <nlohmann/json_fwd.hpp>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace mapweave::runtime {

struct LivePreview {
  struct Part {
    std::vector<MapId> members;  // maps that are one here
    Map map;                     // its nodes and constraints alone
  };
  std::uint64_t number = 0;  // from 1
  std::vector<Part> parts;   // the largest first
};

std::shared_ptr<const LivePreview> preview_of(const fusion::FusionResult&, std::uint64_t number);

// As the live page draws it: {number, maps: [report::live_map()]}. Of large maps not every scan is drawn, and in larger
// cells, so that it takes a second or two and not more. robots: as report::live_page() has them.
nlohmann::ordered_json preview_json(const LivePreview&, const std::vector<std::string>& robots,
                                    const fusion::ComposeOptions&);

}  // namespace mapweave::runtime
