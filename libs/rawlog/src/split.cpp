#include "folder_split.h"
#include "task.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/core/geometry.h>
#include <mapweave/rawlog/contents.h>
#include <mapweave/rawlog/rawlog_writer.h>
#include <mapweave/rawlog/split.h>
#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/obs/CObservation3DRangeScan.h>
#include <mrpt/obs/CObservationImage.h>
#include <mrpt/obs/CObservationOdometry.h>
#include <mrpt/obs/CObservationStereoImages.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>
#include <map>
#include <system_error>
#include <utility>

namespace mapweave::rawlog {
namespace {

constexpr int kMostRobots = 1000;

std::string seconds_text(double seconds) {
  char text[40];
  std::snprintf(text, sizeof text, "%.3f", seconds);
  return text;
}

void check(const SplitOptions& options) {
  const auto refuse = [](const std::string& what, const std::string& remedy) {
    return Error(ErrorCode::kUsage, what, "split", remedy);
  };
  if (options.robots < 1 || options.robots > kMostRobots)
    throw refuse("the number of robots is " + std::to_string(options.robots),
                 "1.." + std::to_string(kMostRobots) + " can be made");
  if (!(options.overlap_s >= 0.0 && options.overlap_s < 1e9))
    throw refuse("the overlap is " + std::to_string(options.overlap_s) + " s", "0 s or more is needed");
  if (options.at_s.empty()) return;
  if (options.at_s.size() + 1 != static_cast<std::size_t>(options.robots)) {
    throw refuse(std::to_string(options.at_s.size()) + " cuts make " + std::to_string(options.at_s.size() + 1) +
                     " parts, not " + std::to_string(options.robots),
                 "give one cut fewer than robots");
  }
  for (std::size_t i = 0; i < options.at_s.size(); ++i) {
    const double cut = options.at_s[i];
    if (!(std::abs(cut) < 4e9))
      throw refuse("the cut " + std::to_string(cut) + " s is no time", "give seconds as in the log");
    if (i > 0 && cut <= options.at_s[i - 1])
      throw refuse("the cut at " + seconds_text(cut) + " s does not come after the one before",
                   "give the cuts in rising order");
  }
}

TimeRange range_of(const std::filesystem::path& log, const SplitOptions& options, Progress& progress) {
  const auto stream = open_log(log, options.reading);
  Task task(progress, "reading " + log.filename().string(), *stream);
  TimeRange range{};
  bool is_first = true;
  while (const auto record = stream->next()) {
    if (std::exchange(is_first, false)) range.first = record->stamp;
    range.last = record->stamp;
    task.step();
  }
  return range;
}

// One robot's log while it is written.
class PartWriter {
 public:
  PartWriter(std::filesystem::path path, Stamp begin, Stamp end) : writer_(path), begin_(begin), end_(end) {
    part_.path = std::move(path);
  }

  void offer(const Record& record) {
    if (record.stamp < begin_ || !(record.stamp < end_)) return;
    if (part_.observations == 0) part_.first = record.stamp;
    part_.last = record.stamp;
    count_observation(*record.observation, part_);
    if (const auto* odometry = dynamic_cast<const mrpt::obs::CObservationOdometry*>(record.observation.get())) {
      const Pose2 pose = odometry->odometry.asTPose();
      const Pose2& origin = origins_.try_emplace(odometry->sensorLabel, pose).first->second;
      mrpt::obs::CObservationOdometry restarted = *odometry;
      restarted.odometry = mrpt::poses::CPose2D(between(origin, pose));
      writer_.add(restarted);
      return;
    }
    writer_.add(*record.observation);
  }
  void close() { writer_.close(); }
  const SplitPart& part() const { return part_; }

 private:
  RawlogWriter writer_;
  Stamp begin_, end_;
  SplitPart part_;
  std::map<std::string, Pose2> origins_;  // odometry from the part's first pose, by label
};

}  // namespace

void count_observation(const mrpt::obs::CObservation& observation, SplitPart& part) {
  ++part.observations;
  part.odometry += dynamic_cast<const mrpt::obs::CObservationOdometry*>(&observation) != nullptr;
  part.scans += dynamic_cast<const mrpt::obs::CObservation2DRangeScan*>(&observation) != nullptr;
  part.frames += dynamic_cast<const mrpt::obs::CObservationImage*>(&observation) != nullptr ||
                 dynamic_cast<const mrpt::obs::CObservationStereoImages*>(&observation) != nullptr ||
                 dynamic_cast<const mrpt::obs::CObservation3DRangeScan*>(&observation) != nullptr;
}

std::vector<Stamp> cuts_of(const SplitOptions& options, const std::function<TimeRange()>& range_of_log) {
  std::vector<Stamp> cuts;
  for (const double at_s : options.at_s) cuts.push_back(stamp_from_seconds(at_s));
  if (!cuts.empty() || options.robots == 1) return cuts;
  const TimeRange range = range_of_log();
  const auto part = (range.last.ns - range.first.ns) / options.robots;
  for (int i = 1; i < options.robots; ++i) cuts.push_back(Stamp{range.first.ns + part * i});
  return cuts;
}

TimeRange part_of(const std::vector<Stamp>& cuts, int part, const SplitOptions& options) {
  const auto overlap_ns = std::llround(options.overlap_s * 1e9);
  return {Stamp{part == 0 ? std::numeric_limits<std::int64_t>::min()
                          : cuts[static_cast<std::size_t>(part) - 1].ns - overlap_ns},
          Stamp{part + 1 == options.robots ? std::numeric_limits<std::int64_t>::max()
                                           : cuts[static_cast<std::size_t>(part)].ns + overlap_ns}};
}

void make_part_folder(const std::filesystem::path& folder) { make_folder(folder, "choose another folder"); }

void expect_parts(const std::filesystem::path& log, const std::vector<Stamp>& cuts, const TimeRange& range,
                  const std::vector<SplitPart>& parts) {
  const std::string span =
      "the log spans " + seconds_text(range.first.seconds()) + " to " + seconds_text(range.last.seconds()) + " s";
  for (const Stamp cut : cuts) {
    if (cut <= range.first || range.last < cut)
      throw Error(ErrorCode::kBadInput, "the cut at " + seconds_text(cut.seconds()) + " s is outside; " + span,
                  log.string(), "cut within it");
  }
  for (const SplitPart& part : parts) {
    if (part.observations == 0)
      throw Error(ErrorCode::kBadInput, "nothing was recorded for " + part.path.filename().string() + "; " + span,
                  log.string(), "make fewer robots, or cut elsewhere");
  }
}

std::vector<SplitPart> split_log(const std::filesystem::path& log, const std::filesystem::path& out_folder,
                                 const SplitOptions& options, Progress& progress) {
  check(options);
  std::error_code problem;
  if (is_picture_folder(log)) return split_folder(log, out_folder, options, progress);
  const auto cuts = cuts_of(options, [&] { return range_of(log, options, progress); });
  const auto stream = open_log(log, options.reading);
  make_part_folder(out_folder);
  std::vector<std::unique_ptr<PartWriter>> parts;
  for (int i = 0; i < options.robots; ++i) {
    const TimeRange part = part_of(cuts, i, options);
    parts.push_back(
        std::make_unique<PartWriter>(out_folder / ("robot" + std::to_string(i) + ".rawlog"), part.first, part.last));
  }

  TimeRange range{};
  bool is_first = true;
  {
    Task task(progress, "splitting " + log.filename().string(), *stream);
    while (const auto record = stream->next()) {
      if (std::exchange(is_first, false)) range.first = record->stamp;
      range.last = record->stamp;
      for (auto& part : parts) part->offer(*record);
      task.step();
    }
  }
  std::vector<SplitPart> planned;
  for (const auto& part : parts) planned.push_back(part->part());
  expect_parts(log, cuts, range, planned);

  std::vector<SplitPart> written;
  try {
    for (auto& part : parts) {
      part->close();
      written.push_back(part->part());
    }
  } catch (...) {
    for (const auto& part : written) std::filesystem::remove(part.path, problem);
    throw;
  }
  return written;
}

}  // namespace mapweave::rawlog
