#pragma once
// The parts of a recording that its recorder split, read as one.

#include "bag_reader.h"

#include <filesystem>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace mapweave::rawlog::ros {

struct OpenedPart {
  std::shared_ptr<void> kept;  // outlives the reader; may be null
  std::unique_ptr<BagReader> reader;
};

struct BagParts {
  std::vector<std::filesystem::path> paths;                        // one after the other
  std::vector<BagTopic> topics;                                    // of all of them; empty: each part is asked
  std::function<OpenedPart(const std::filesystem::path&)> open;    // throws Error
  std::function<std::string(const std::filesystem::path&)> place;  // " at byte ", before the place within a part
};

// Topics of the same name, type and encoding are one. Parts are opened one at a time. One that cannot be opened is
// reported when reading comes to it, the first one at once.
std::unique_ptr<BagReader> open_bag_parts(BagParts parts);

}  // namespace mapweave::rawlog::ros
