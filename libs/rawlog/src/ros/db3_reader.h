#pragma once

#include "bag_reader.h"

#include <filesystem>
#include <memory>

namespace mapweave::rawlog::ros {

// As open_db3(), of a file that messages call `shown`.
std::unique_ptr<BagReader> open_db3_as(const std::filesystem::path& path, const std::filesystem::path& shown,
                                       std::uint64_t most_bytes);

}  // namespace mapweave::rawlog::ros
