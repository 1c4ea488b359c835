#pragma once
// What the cloud makes of robots' maps, with the defaults and one thread.

#include <mapweave/fusion/fuse.h>

#include <vector>

namespace mapweave::test {

inline fusion::FusionResult fused(std::vector<Map> maps, std::vector<fusion::MapPrior> priors = {}) {
  WorkerPool pool(1);
  fusion::Memo memo;
  const auto progress = make_silent_progress();
  fusion::FusionInput input{std::move(maps), {}, TierId("cloud")};
  input.priors = std::move(priors);
  return fusion::fuse(input, {}, memo, pool, *progress);
}

}  // namespace mapweave::test
