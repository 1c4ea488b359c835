#pragma once
// What the topics of a bag hold.

#include <mapweave/rawlog/contents.h>

#include <filesystem>
#include <vector>

namespace mapweave::rawlog::ros {

// By name; nothing for a log that is no bag. Of a damaged bag what stands before the damage.
std::vector<TopicContents> topics_of_bag(const std::filesystem::path& path, const ReadOptions& options);

}  // namespace mapweave::rawlog::ros
