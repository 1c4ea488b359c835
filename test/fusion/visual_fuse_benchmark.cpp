// How long maps of cameras take to join, stage by stage, one thread: medians of several rounds. Wall times of stages;
// of all, processor time too.
//   visual_fuse_benchmark [--rounds N] [--keyframes N] [--seed N] [MAP.mwdb...]
// Without maps, those of two robots that drive through an apartment until both together have so many keyframes: 456, as
// in CORB-SLAM's table 2. Then their errors are printed, too.
#include <mapweave/core/error.h>
#include <mapweave/core/median.h>
#include <mapweave/mapdb/map_store.h>
#include <support/feature_team.h>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <filesystem>
#include <string>

using namespace mapweave;
using test::FeatureTeam;

namespace {

struct Arguments {
  int rounds = 5;
  std::size_t keyframes = 456;
  std::int64_t seed = 2;  // an apartment in which neither is lost: a map each
  std::vector<std::string> maps;
};

Arguments arguments_of(int count, char** words) {
  Arguments arguments;
  for (int i = 1; i < count; ++i) {
    const std::string word = words[i];
    const auto number = [&] { return i + 1 < count ? std::max(1, std::atoi(words[++i])) : 1; };
    if (word == "--rounds")
      arguments.rounds = number();
    else if (word == "--keyframes")
      arguments.keyframes = static_cast<std::size_t>(number());
    else if (word == "--seed")
      arguments.seed = number();
    else
      arguments.maps.push_back(word);
  }
  return arguments;
}

std::vector<Map> read(const std::vector<std::string>& files) {
  std::vector<Map> result;
  for (const std::string& file : files) {
    const std::string name = std::filesystem::path(file).stem().string();
    auto maps = mapdb::read_store(file).maps;
    for (std::size_t part = 0; part < maps.size(); ++part) {
      maps[part].id = MapId(maps.size() == 1 ? name : name + "." + std::to_string(part));
      result.push_back(std::move(maps[part]));
    }
  }
  return result;
}

void drive(FeatureTeam& team, std::size_t keyframes) {
  const auto known = [&] {
    std::size_t sum = 0;
    for (const auto& robot : team.robots) sum += robot.client->keyframes().size();
    return sum;
  };
  while (known() < keyframes && team.round()) {}
  team.finish();
}

void measure(const fusion::FusionInput& input, int rounds, const FeatureTeam* simulated) {
  WorkerPool pool(1);
  const auto progress = make_silent_progress();
  fusion::FusionResult result;
  std::vector<std::vector<double>> stages;
  std::vector<double> wall, processor;
  for (int round = 0; round < rounds; ++round) {
    fusion::Memo memo;
    fusion::FusionInput fresh = input;
    fresh.pictures = std::make_shared<fusion::BagOfWordsCache>();
    const std::clock_t before = std::clock();
    result = fusion::fuse(fresh, {}, memo, pool, *progress);
    processor.push_back(static_cast<double>(std::clock() - before) / CLOCKS_PER_SEC);
    wall.push_back(0.0);
    stages.resize(result.stages.size());
    for (std::size_t i = 0; i < stages.size(); ++i) {
      stages[i].push_back(result.stages[i].seconds);
      wall.back() += result.stages[i].seconds;
    }
  }
  std::size_t keyframes = 0, landmarks = 0;
  for (const Map& map : input.maps) {
    landmarks += map.landmarks.size();
    for (const auto& entry : map.nodes) keyframes += keyframe_of(entry.second) != nullptr;
  }
  std::printf("%zu maps, %zu keyframes, %zu landmarks -> %zu teams; %zu judgements\n", input.maps.size(), keyframes,
              landmarks, result.components.size(), result.judgements.size());
  for (std::size_t i = 0; i < stages.size(); ++i)
    std::printf("%-24s %8.4f s\n", result.stages[i].name.c_str(), median(stages[i]));
  std::printf("%-24s %8.4f s, %.4f s of a processor\n", "in all", median(wall), median(processor));
  for (const Verdict& verdict : result.verdicts)
    std::printf("%s, %s: %s %s, %zu witnesses, %zu contradicted\n", verdict.a.str().c_str(), verdict.b.str().c_str(),
                to_text(verdict.decision).data(), to_text(verdict.reason).data(), verdict.witnesses.size(),
                verdict.contradicted.size());
  if (simulated == nullptr) return;
  for (const auto& robot : simulated->robots)
    std::printf("%s alone: error %.5f m\n", robot.place.client.robot.str().c_str(), robot.error_m());
  for (const auto& component : result.components)
    std::printf("team of %zu: error %.5f m\n", component.members.size(), simulated->error_m(component));
}

}  // namespace

int main(int count, char** words) {
  try {
    const Arguments arguments = arguments_of(count, words);
    fusion::FusionInput input;
    if (!arguments.maps.empty()) {
      input.maps = read(arguments.maps);
      measure(input, arguments.rounds, nullptr);
      return 0;
    }
    tiers::ServerOptions keeping;  // joined below
    keeping.fuse_after = 100000;
    // More path than they need: several keyframes to a metre.
    FeatureTeam team(test::apartment(2, 0.15 * static_cast<double>(arguments.keyframes), arguments.seed), keeping);
    drive(team, arguments.keyframes);
    input.maps = team.server.maps();
    measure(input, arguments.rounds, &team);
  } catch (const Error& error) {
    std::fprintf(stderr, "%s\n", error.what());
    return 2;
  }
  return 0;
}
