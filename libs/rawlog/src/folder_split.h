#pragma once
// Cutting folders of pictures, and what cutting a log shares with it.

#include "camera_folder.h"

#include <mapweave/rawlog/split.h>

#include <functional>
#include <vector>

namespace mapweave::rawlog {

struct TimeRange {
  Stamp first, last;
};

// The cuts that are asked for, else those of equal parts.
std::vector<Stamp> cuts_of(const SplitOptions& options, const std::function<TimeRange()>& range_of_log);
// From `first` up to, and without, `last`.
TimeRange part_of(const std::vector<Stamp>& cuts, int part, const SplitOptions& options);
// Throws Error kBadInput for cuts outside the log and for parts without observations.
void expect_parts(const std::filesystem::path& log, const std::vector<Stamp>& cuts, const TimeRange& range,
                  const std::vector<SplitPart>& parts);
// One more observation of a part.
void count_observation(const mrpt::obs::CObservation& observation, SplitPart& part);
void make_part_folder(const std::filesystem::path& folder);  // throws Error kCannotWrite

std::vector<SplitPart> split_folder(const std::filesystem::path& folder, const std::filesystem::path& out_folder,
                                    const SplitOptions& options, Progress& progress);

// For the layouts. All throw Error kCannotWrite.
// Links a picture into a part, following symbolic links; copies it where it cannot be linked.
void link_file(const std::filesystem::path& from, const std::filesystem::path& to);
// Copies calibrations and the like: whoever edits them means the part.
void copy_if_there(const CameraFolder& whole, const std::filesystem::path& name, const std::filesystem::path& out);
void write_list(const std::filesystem::path& to, const std::string& text);
// The inertial measurements of the part's time.
void cut_imu(const CameraFolder& whole, const FolderPart& part, const std::filesystem::path& out);

}  // namespace mapweave::rawlog
