#pragma once
// What the targets of recordings share: a log read to its end, with its pictures.

#include "fuzz_target.h"

#include <mapweave/rawlog/observation_stream.h>

namespace mapweave::fuzz {

inline rawlog::ReadOptions small_logs() {
  rawlog::ReadOptions options;
  options.max_object_mb = 4.0;
  return options;
}

// Stamps rise, but for the Error that ends it.
inline void read_log(const std::filesystem::path& path, const rawlog::ReadOptions& options = small_logs()) {
  const auto log = rawlog::open_log(path, options);
  Stamp before{std::numeric_limits<std::int64_t>::min()};
  while (const auto record = log->next()) {
    expect(!(record->stamp < before), "records come in the order of their stamps");
    before = record->stamp;
    rawlog::load_pictures(*record->observation);
  }
}

}  // namespace mapweave::fuzz
