#pragma once
// What the cloud makes of robots' maps, with the defaults and one thread.

#include <mapweave/fusion/fuse.h>

#include <vector>

namespace mapweave::test {

inline fusion::FusionResult fused(std::vector<Map> maps) {
  WorkerPool pool(1);
  fusion::Memo memo;
  const auto progress = make_silent_progress();
  return fusion::fuse({std::move(maps), {}, TierId("cloud")}, {}, memo, pool, *progress);
}

}  // namespace mapweave::test
