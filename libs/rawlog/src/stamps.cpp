#include <mapweave/core/error.h>
#include <mapweave/rawlog/observation_stream.h>

namespace mapweave::rawlog {
namespace {

constexpr std::int64_t kEpochTicks = 116'444'736'000'000'000;  // 1601 to 1970, in steps of 100 ns
constexpr std::int64_t kMostTicks =
    40'000'000'000'000'000;  // 4e9 s either way: two stamps' distance fits 64 bits of nanoseconds

}  // namespace

bool has_stamp(mrpt::Clock::time_point time) {
  const std::int64_t ticks = time.time_since_epoch().count();
  return ticks >= kEpochTicks - kMostTicks && ticks <= kEpochTicks + kMostTicks;
}

Stamp to_stamp(mrpt::Clock::time_point time) {
  MAPWEAVE_EXPECT(has_stamp(time), "a time that MRPT has set");
  return Stamp{(static_cast<std::int64_t>(time.time_since_epoch().count()) - kEpochTicks) * 100};
}

mrpt::Clock::time_point to_mrpt_time(Stamp stamp) {
  const std::int64_t rounded = stamp.ns >= 0 ? (stamp.ns + 50) / 100 : -((-stamp.ns + 49) / 100);
  return mrpt::Clock::time_point(mrpt::Clock::duration(rounded + kEpochTicks));
}

}  // namespace mapweave::rawlog
