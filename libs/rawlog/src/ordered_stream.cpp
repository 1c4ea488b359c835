#include "ordered_stream.h"

#include <mapweave/core/error.h>
#include <mapweave/core/log.h>
#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/obs/CObservationOdometry.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <exception>
#include <map>
#include <tuple>

namespace mapweave::rawlog {
namespace {

constexpr std::size_t kMostWaiting =
    200'000;  // records within the window; a log that stands still would fill the memory

struct Waiting {
  Record record;
  int rank;              // 0: odometry
  std::uint64_t number;  // in the file, from 1
};

// For std::push_heap: the first to leave is the largest.
bool leaves_later(const Waiting& a, const Waiting& b) {
  return std::tie(b.record.stamp.ns, b.rank, b.number) < std::tie(a.record.stamp.ns, a.rank, a.number);
}

std::string seconds_text(Stamp stamp) {
  char text[40];
  std::snprintf(text, sizeof text, "%.6f s", stamp.seconds());
  return text;
}

// How far each topic of a recording that still grows has come. Nothing can come before what all of them have passed.
class TopicTimes {
 public:
  void add(const std::string& topic, Stamp stamp) {
    if (newest_.empty()) first_ = stamp;
    const auto [known, is_new] = newest_.emplace(topic, stamp);
    is_steady_ = is_steady_ && !(stamp < known->second);
    known->second = std::max(known->second, stamp);
  }
  // From now on a record waits for the whole window.
  void doubt() { is_steady_ = false; }
  bool have_passed(const std::string& topic, Stamp stamp) const {
    return is_steady_ && seconds_between(first_, stamp) > kUntilAllHaveBegun_s &&
           std::all_of(newest_.begin(), newest_.end(),
                       [&](const auto& entry) { return entry.first == topic || stamp < entry.second; });
  }

 private:
  static constexpr double kUntilAllHaveBegun_s = 5.0;

  std::map<std::string, Stamp> newest_;
  Stamp first_;
  bool is_steady_ = true;  // no topic has gone backwards
};

class OrderedStream final : public ObservationStream {
 public:
  OrderedStream(std::unique_ptr<RecordSource> source, const ReadOptions& options)
      : source_(std::move(source)),
        window_s_(source_->is_in_order() ? 0.0 : options.reorder_window_s),
        window_ns_(std::llround(std::min(window_s_, 1e9) * 1e9)),
        follows_(options.follow) {}

  std::optional<Record> next() override {
    while (!ended_ && (heap_.empty() || !may_leave(heap_.front().record))) read_more();
    if (!heap_.empty()) {
      left_ = std::max(left_.value_or(heap_.front().record.stamp), heap_.front().record.stamp);
      std::pop_heap(heap_.begin(), heap_.end(), leaves_later);
      Record record = std::move(heap_.back().record);
      heap_.pop_back();
      return record;
    }
    if (failure_) std::rethrow_exception(failure_);
    return std::nullopt;
  }
  std::uint64_t bytes_read() const override { return source_->bytes_read(); }
  std::uint64_t bytes_total() const override { return source_->bytes_total(); }

 private:
  bool may_leave(const Record& record) const {
    return newest_.ns - record.stamp.ns > window_ns_ ||
           (follows_ && topics_.have_passed(record.observation->sensorLabel, record.stamp));
  }

  // A topic that began after what the others had passed has left, or went backwards.
  bool is_left_out(const Record& record) {
    if (!follows_) return false;
    topics_.add(record.observation->sensorLabel, record.stamp);
    if (!left_ || !(record.stamp < *left_)) return false;
    topics_.doubt();
    if (left_out_++ == 0)
      log(LogLevel::warning, source_->path() + ": a record of '" + record.observation->sensorLabel + "' came " +
                                 std::to_string(seconds_between(record.stamp, *left_)) +
                                 " s after newer ones of all other topics had been read; it is left out, as others "
                                 "that come so late, and from now "
                                 "on records wait for reading.reorder_window_s");
    return true;
  }

  void read_more() {
    fresh_.clear();
    try {
      ended_ = !source_->read(fresh_);
    } catch (const Error&) {
      fail();
    }
    try {
      for (auto& placed : fresh_) add(placed);
      if (ended_ && !failure_ && count_ == 0) {
        const std::string found = source_->nothing_found();
        throw Error(ErrorCode::kBadInput,
                    "holds no observations" + (found.empty() ? "" : " (" + found + ")") + "; at least one was expected",
                    source_->path(), "record again, or check that this is the right file");
      }
    } catch (const Error&) {
      fail();
    }
  }

  // What is waiting is still given; then comes the error.
  void fail() {
    ended_ = true;
    failure_ = std::current_exception();  // should looking for its cause be interrupted
    failure_ = source_->cause_of(failure_);
  }

  void add(PlacedRecord& placed) {
    ++count_;
    const auto where = [&] { return source_->place_name(placed.place) + ", record " + std::to_string(count_); };
    int rank = 1;
    if (auto* scan = dynamic_cast<mrpt::obs::CObservation2DRangeScan*>(placed.record.observation.get())) {
      check_scan(*scan, where);
    } else if (const auto* odometry =
                   dynamic_cast<const mrpt::obs::CObservationOdometry*>(placed.record.observation.get())) {
      rank = 0;
      const auto& pose = odometry->odometry;
      if (!std::isfinite(pose.x()) || !std::isfinite(pose.y()) || !std::isfinite(pose.phi())) {
        throw Error(ErrorCode::kBadInput, "an odometry pose is not a number; finite x, y, heading were expected",
                    where(), "map what precedes it with --keep-going");
      }
    }
    if (count_ > 1 && newest_.ns - placed.record.stamp.ns > window_ns_) {
      throw Error(
          ErrorCode::kBadInput,
          "time runs backwards: stamp " + seconds_text(placed.record.stamp) + " comes after stamp " +
              seconds_text(newest_) + ", later than the window of " + std::to_string(window_s_) + " s allows",
          where(),
          "repair the clock of the recording, map what precedes it with --keep-going, or widen reorder_window_s");
    }
    if (is_left_out(placed.record)) return;
    newest_.ns = count_ > 1 ? std::max(newest_.ns, placed.record.stamp.ns) : placed.record.stamp.ns;
    heap_.push_back({std::move(placed.record), rank, count_});
    std::push_heap(heap_.begin(), heap_.end(), leaves_later);
    if (heap_.size() > kMostWaiting) {
      throw Error(ErrorCode::kBadInput,
                  "more than " + std::to_string(kMostWaiting) + " records within " + std::to_string(window_s_) +
                      " s; stamps that advance were expected",
                  where(), "repair the stamps (carmen2rawlog of MRPT writes wrong ones), or narrow reorder_window_s");
    }
  }

  template <class Where>
  static void check_scan(mrpt::obs::CObservation2DRangeScan& scan, const Where& where) {
    const std::size_t rays = scan.getScanSize();
    if (rays == 0) {
      throw Error(ErrorCode::kBadInput, "a scan of '" + scan.sensorLabel + "' has no rays; at least one was expected",
                  where(), "map what precedes it with --keep-going");
    }
    const float* ranges = &scan.getScanRange(0);
    if (std::all_of(ranges, ranges + rays, [](float range) { return std::isfinite(range); })) return;
    for (std::size_t i = 0; i < rays; ++i) {
      if (std::isfinite(ranges[i]) || !scan.getScanRangeValidity(i)) continue;
      if (std::isnan(ranges[i])) {
        throw Error(
            ErrorCode::kBadInput,
            "ray " + std::to_string(i) + " of a scan of '" + scan.sensorLabel + "' is not a number, yet marked valid",
            where(), "map what precedes it with --keep-going, or mark such rays invalid when recording");
      }
      scan.setScanRangeValidity(i, false);  // infinite: no return (the habit of ROS)
    }
  }

  std::unique_ptr<RecordSource> source_;
  double window_s_;
  std::int64_t window_ns_;
  std::vector<Waiting> heap_;
  std::vector<PlacedRecord> fresh_;
  Stamp newest_;
  std::optional<Stamp> left_;  // the newest one that has been given
  bool follows_;
  TopicTimes topics_;
  std::uint64_t left_out_ = 0;
  std::uint64_t count_ = 0;
  bool ended_ = false;
  std::exception_ptr failure_;
};

}  // namespace

std::unique_ptr<ObservationStream> make_ordered_stream(std::unique_ptr<RecordSource> source,
                                                       const ReadOptions& options) {
  return std::make_unique<OrderedStream>(std::move(source), options);
}

}  // namespace mapweave::rawlog
