// Previews of maps that grow: what is looked for in each of them.

#include <gmock/gmock.h>
#include <mapweave/fusion/fuse.h>
#include <support/simulated_maps.h>

namespace mapweave::fusion {
namespace {

const std::vector<Map>& maps() {
  static const std::vector<Map> maps = [] {
    std::vector<Map> result;
    simulation::TeamOptions options;
    options.robots = 4;
    options.shared = 0.6;
    const auto team = simulation::make_apartment({}, options);
    for (const auto& robot : team.robots) result.push_back(test::mapped(robot, team.laser));
    return result;
  }();
  return maps;
}

std::vector<MapId> largest_team(std::optional<std::size_t> most_new_questions, Memo& memo) {
  WorkerPool pool(2);
  const auto progress = make_silent_progress();
  FusionInput input;
  input.maps = maps();
  input.by = TierId("cloud");
  input.is_preview = true;
  input.most_new_questions = most_new_questions;
  std::vector<MapId> largest;
  for (const Component& component : fuse(input, {}, memo, pool, *progress).components)
    if (component.members.size() > largest.size()) largest = component.members;
  return largest;
}

TEST(Preview, answers_no_more_new_questions_than_it_may) {
  Memo memo;
  EXPECT_EQ(largest_team(0, memo).size(), 1U);
  EXPECT_TRUE(memo.empty());
}

TEST(Preview, finds_little_by_little_what_it_would_find_at_once) {
  Memo all;
  const std::vector<MapId> wanted = largest_team({}, all);
  ASSERT_EQ(wanted.size(), 4U);
  Memo memo;
  std::vector<MapId> found;
  int previews = 0;
  for (; previews < 30 && found != wanted; ++previews) found = largest_team(4, memo);
  EXPECT_EQ(found, wanted);
  EXPECT_GT(previews, 1);
}

}  // namespace
}  // namespace mapweave::fusion
