// How long maps of cameras take to join, stage by stage: the least of several rounds, one thread. Wall times of stages; of
// all, processor time too.
//   visual_fuse_benchmark [--rounds N] MAP.mwdb MAP.mwdb...
#include <mapweave/fusion/fuse.h>
#include <mapweave/mapdb/map_store.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <string>

using namespace mapweave;

int main(int count, char** words) {
  int rounds = 5;
  fusion::FusionInput input;
  for (int i = 1; i < count; ++i) {
    if (std::string(words[i]) == "--rounds" && i + 1 < count) {
      rounds = std::max(1, std::atoi(words[++i]));
      continue;
    }
    const std::string name = std::filesystem::path(words[i]).stem().string();
    auto maps = mapdb::read_store(words[i]).maps;
    for (std::size_t part = 0; part < maps.size(); ++part) {
      maps[part].id = MapId(maps.size() == 1 ? name : name + "." + std::to_string(part));
      input.maps.push_back(std::move(maps[part]));
    }
  }
  if (input.maps.empty()) {
    std::fprintf(stderr, "usage: visual_fuse_benchmark [--rounds N] MAP.mwdb MAP.mwdb...\n");
    return 2;
  }
  WorkerPool pool(1);
  const auto progress = make_silent_progress();
  fusion::FusionResult result;
  std::vector<fusion::StageTime> least;
  double least_cpu_s = 1e300;
  for (int round = 0; round < rounds; ++round) {
    fusion::Memo memo;
    const std::clock_t before = std::clock();
    result = fusion::fuse(input, {}, memo, pool, *progress);
    least_cpu_s = std::min(least_cpu_s, static_cast<double>(std::clock() - before) / CLOCKS_PER_SEC);
    if (round == 0) least = result.stages;
    for (std::size_t i = 0; i < least.size(); ++i) least[i].seconds = std::min(least[i].seconds, result.stages[i].seconds);
  }
  std::size_t keyframes = 0, landmarks = 0;
  for (const Map& map : input.maps) {
    landmarks += map.landmarks.size();
    for (const auto& entry : map.nodes) keyframes += keyframe_of(entry.second) != nullptr;
  }
  std::printf("%zu maps, %zu keyframes, %zu landmarks -> %zu teams; %zu judgements\n", input.maps.size(), keyframes, landmarks,
              result.components.size(), result.judgements.size());
  double sum = 0.0;
  for (const fusion::StageTime& stage : least) std::printf("%-24s %8.4f s\n", stage.name.c_str(), stage.seconds), sum += stage.seconds;
  std::printf("%-24s %8.4f s, %.4f s of a processor\n", "in all", sum, least_cpu_s);
  for (const Verdict& verdict : result.verdicts)
    std::printf("%s, %s: %s %s, %zu witnesses, %zu contradicted\n", verdict.a.str().c_str(), verdict.b.str().c_str(),
                to_text(verdict.decision).data(), to_text(verdict.reason).data(), verdict.witnesses.size(), verdict.contradicted.size());
  return 0;
}
