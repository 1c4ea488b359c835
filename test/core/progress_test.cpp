#include "progress_lines.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/core/error.h>

#include <thread>
#include <vector>

namespace mapweave {
namespace {

using testing::ElementsAre;
using testing::IsEmpty;

struct Screen {
  std::vector<std::string> lines, live;
  double now_s = 100.0;
  std::unique_ptr<Progress> progress(bool is_live) {
    return make_progress({is_live, [this](std::string_view line) { lines.emplace_back(line); },
                          [this](std::string_view line) { live.emplace_back(line); }, [this] { return now_s; }});
  }
};

TEST(PlainProgress, says_where_it_is_every_ten_seconds) {
  Screen screen;
  const auto progress = screen.progress(false);
  const int task = progress->begin("alpha", 4000, "scans");
  for (int second = 1; second <= 25; ++second) {
    screen.now_s += 1.0;
    progress->advance(task, static_cast<std::uint64_t>(40 * second));
  }
  progress->end(task);
  EXPECT_THAT(
      screen.lines,
      ElementsAre("alpha: begins, 4000 scans", "alpha: 400 scans (10 %), 40 scans/s, 1:30 min left",
                  "alpha: 800 scans (20 %), 40 scans/s, 1:20 min left", "alpha: done, 1000 scans, 40 scans/s, 25 s"));
  EXPECT_THAT(screen.live, IsEmpty());
}

TEST(PlainProgress, does_without_a_total) {
  Screen screen;
  const auto progress = screen.progress(false);
  const int task = progress->begin("reading", 0, "MB");
  screen.now_s += 10.0;
  progress->advance(task, 15);
  EXPECT_THAT(screen.lines, ElementsAre("reading: begins", "reading: 15 MB, 1.50 MB/s"));
}

TEST(PlainProgress, says_nothing_of_a_rate_before_anything_is_done) {
  Screen screen;
  const auto progress = screen.progress(false);
  progress->end(progress->begin("nothing", 10, "pairs"));
  EXPECT_THAT(screen.lines, ElementsAre("nothing: begins, 10 pairs", "nothing: done, 0 pairs, 0 s"));
}

TEST(LiveProgress, shows_all_tasks_in_one_line_ten_times_a_second_at_most) {
  Screen screen;
  const auto progress = screen.progress(true);
  const int alpha = progress->begin("alpha", 100, "scans"), beta = progress->begin("beta", 50, "scans");
  screen.live.clear();
  for (int step = 1; step <= 100; ++step) {
    screen.now_s += 0.01;
    progress->advance(alpha, static_cast<std::uint64_t>(step) / 2);
  }
  EXPECT_LE(screen.live.size(), 11u);
  EXPECT_GE(screen.live.size(), 9u);
  EXPECT_TRUE(screen.live.back().rfind("alpha: ", 0) == 0 &&
              screen.live.back().find(" | beta: 0 scans (0 %)") != std::string::npos)
      << screen.live.back();
  progress->end(alpha);
  progress->end(beta);
  EXPECT_EQ(screen.live.back(), "") << "nothing stays behind";
  EXPECT_EQ(screen.lines.size(), 2u);
}

TEST(Progress, keeps_a_line_that_is_said) {
  Screen screen;
  screen.progress(true)->say("alpha: 3 loops closed");
  screen.progress(false)->say("alpha: 3 loops closed");
  EXPECT_THAT(screen.lines, ElementsAre("alpha: 3 loops closed", "alpha: 3 loops closed"));
}

TEST(Progress, survives_more_than_was_announced) {
  Screen screen;
  const auto progress = screen.progress(false);
  const int task = progress->begin("alpha", 10, "scans");
  screen.now_s += 20.0;
  progress->advance(task, 25'000'000);
  EXPECT_EQ(screen.lines.back(), "alpha: 25000000 scans (100 %), 1.25M scans/s");
}

TEST(Progress, refuses_tasks_it_does_not_know) {
  Screen screen;
  const auto progress = screen.progress(false);
  const int task = progress->begin("alpha", 1, "scans");
  progress->end(task);
  EXPECT_THROW(progress->advance(task, 1), ContractViolation);
}

TEST(Progress, may_be_reported_by_many_threads) {
  testing::internal::CaptureStderr();
  {
    const auto progress = make_terminal_progress();
    std::vector<std::thread> threads;
    for (int robot = 0; robot < 4; ++robot) {
      threads.emplace_back([&progress, robot] {
        const int task = progress->begin("robot" + std::to_string(robot), 100, "scans");
        for (std::uint64_t done = 1; done <= 100; ++done) progress->advance(task, done);
        progress->end(task);
      });
    }
    for (auto& thread : threads) thread.join();
  }
  const std::string text = testing::internal::GetCapturedStderr();
  for (int robot = 0; robot < 4; ++robot)
    EXPECT_NE(text.find("robot" + std::to_string(robot) + ": done, 100 scans"), std::string::npos) << text;
}

TEST(SilentProgress, says_nothing) {
  testing::internal::CaptureStderr();
  const auto progress = make_silent_progress();
  progress->advance(progress->begin("alpha", 1, "scans"), 1);
  progress->say("hello");
  EXPECT_EQ(testing::internal::GetCapturedStderr(), "");
}

}  // namespace
}  // namespace mapweave
