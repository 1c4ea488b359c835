#pragma once
// Any recording that is read becomes an MRPT rawlog of observations in the order of stamps.

#include <mapweave/core/progress.h>
#include <mapweave/rawlog/observation_stream.h>

namespace mapweave::rawlog {

// Answers the number of observations written. Throws what reading and writing throw, and then leaves nothing behind.
std::uint64_t convert_log(const std::filesystem::path& log, const std::filesystem::path& out, Progress& progress,
                          const ReadOptions& options = {});

}  // namespace mapweave::rawlog
