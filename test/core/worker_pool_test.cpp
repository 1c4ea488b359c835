#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/core/worker_pool.h>

#include <atomic>
#include <mutex>
#include <set>
#include <stdexcept>
#include <thread>

namespace mapweave {
namespace {

class WorkerPoolOf : public testing::TestWithParam<int> {};
INSTANTIATE_TEST_SUITE_P(Threads, WorkerPoolOf, testing::Values(1, 2, 3, 8));

TEST_P(WorkerPoolOf, calls_each_number_once) {
  WorkerPool pool(GetParam());
  EXPECT_EQ(pool.threads(), GetParam());
  for (const std::size_t count : {0u, 1u, 2u, 1000u}) {
    std::vector<std::atomic<int>> calls(count);
    pool.for_each(count, [&](std::size_t i) { ++calls[i]; });
    for (const auto& number : calls) EXPECT_EQ(number, 1);
  }
}

TEST_P(WorkerPoolOf, gives_results_in_the_order_of_their_numbers) {
  WorkerPool pool(GetParam());
  const auto squares = pool.map(500, [](std::size_t i) { return i * i; });
  ASSERT_EQ(squares.size(), 500u);
  for (std::size_t i = 0; i < squares.size(); ++i) EXPECT_EQ(squares[i], i * i);
}

TEST_P(WorkerPoolOf, returns_results_that_can_only_be_moved) {
  WorkerPool pool(GetParam());
  const auto boxes = pool.map(10, [](std::size_t i) { return std::make_unique<std::size_t>(i); });
  EXPECT_EQ(*boxes[7], 7u);
}

TEST_P(WorkerPoolOf, nests_without_waiting_for_ever) {
  WorkerPool pool(GetParam());
  std::atomic<int> calls{0};
  pool.for_each(
      7, [&](std::size_t) { pool.for_each(5, [&](std::size_t) { pool.for_each(3, [&](std::size_t) { ++calls; }); }); });
  EXPECT_EQ(calls, 7 * 5 * 3);
}

TEST_P(WorkerPoolOf, rethrows_the_exception_of_the_lowest_number_after_all_have_run) {
  WorkerPool pool(GetParam());
  for (int repetition = 0; repetition < 20; ++repetition) {
    std::atomic<int> calls{0};
    try {
      pool.for_each(64, [&](std::size_t i) {
        ++calls;
        if (i % 10 == 3) throw std::runtime_error("number " + std::to_string(i));
      });
      FAIL() << "nothing was thrown";
    } catch (const std::runtime_error& error) {
      EXPECT_STREQ(error.what(), "number 3");
    }
    EXPECT_EQ(calls, 64);
  }
  EXPECT_EQ(pool.map(3, [](std::size_t i) { return i; }).size(), 3u) << "it works on after a failure";
}

TEST_P(WorkerPoolOf, carries_an_exception_out_of_a_nested_call) {
  WorkerPool pool(GetParam());
  EXPECT_THROW(pool.for_each(4,
                             [&](std::size_t i) {
                               pool.for_each(4, [&](std::size_t j) {
                                 if (i == 2 && j == 1) throw Error(ErrorCode::kCorrupt, "x");
                               });
                             }),
               Error);
}

TEST_P(WorkerPoolOf, serves_several_callers_at_once) {
  WorkerPool pool(GetParam());
  std::vector<std::thread> callers;
  std::atomic<int> calls{0};
  for (int c = 0; c < 4; ++c) {
    callers.emplace_back([&] {
      for (int i = 0; i < 20; ++i) pool.for_each(10, [&](std::size_t) { ++calls; });
    });
  }
  for (auto& caller : callers) caller.join();
  EXPECT_EQ(calls, 4 * 20 * 10);
}

TEST(WorkerPool, works_in_the_calling_thread_where_it_is_the_only_one) {
  WorkerPool pool(1);
  pool.for_each(5,
                [caller = std::this_thread::get_id()](std::size_t) { EXPECT_EQ(std::this_thread::get_id(), caller); });
}

TEST(WorkerPool, uses_all_its_threads) {
  WorkerPool pool(3);
  std::mutex mutex;
  std::set<std::thread::id> seen;
  std::atomic<int> inside{0};
  pool.for_each(3, [&](std::size_t) {
    {
      const std::lock_guard lock(mutex);
      seen.insert(std::this_thread::get_id());
    }
    ++inside;
    while (inside < 3) std::this_thread::yield();  // ends only when all three are inside together
  });
  EXPECT_EQ(seen.size(), 3u);
}

TEST(WorkerPool, needs_a_thread) { EXPECT_THROW(WorkerPool(0), ContractViolation); }

}  // namespace
}  // namespace mapweave
