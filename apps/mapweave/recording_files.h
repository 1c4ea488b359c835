#pragma once
// Maps as recordings of ROS, in files that `export --bag` and `--mcap` name.

#include <mapweave/exporters/ros_recording.h>

#include <filesystem>
#include <string>
#include <vector>

namespace mapweave::app {

struct RecordingFiles {
  std::filesystem::path bag, mcap;  // empty: none
  bool any() const { return !bag.empty() || !mcap.empty(); }
};

// Throws Error: kUsage for a path that is an input, a file of another kind or one of a folder of results, or that both
// have; kCannotWrite where a file is there, unless `force`.
void expect_free(const RecordingFiles&, const std::vector<std::filesystem::path>& inputs, bool force);

struct RecordingBytes {
  std::filesystem::path path;
  std::string_view ending;
  std::string bytes;
};
// Throws Error kBadInput where the maps hold nothing that can be recorded, and as ros1_bag_bytes() does.
std::vector<RecordingBytes> recordings_of(const std::vector<exporters::RecordedMap>&, const RecordingFiles&);

}  // namespace mapweave::app
