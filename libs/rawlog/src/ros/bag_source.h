#pragma once
// A bag as records of observations.

#include "../record_source.h"
#include "bag_reader.h"

#include <filesystem>
#include <memory>

namespace mapweave::rawlog::ros {

// Throws Error for a bag of which nothing can be mapped, or where a choice is needed (topic_choice.h).
std::unique_ptr<RecordSource> open_bag_source(std::unique_ptr<BagReader> bag, const std::filesystem::path& path,
                                              const ReadOptions& options);

}  // namespace mapweave::rawlog::ros
