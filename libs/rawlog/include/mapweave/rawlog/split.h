#pragma once
// Makes the logs of several robots out of one, cut by time (CORB-SLAM, section 3.1: each part grows by an overlap on
// either side).

#include <mapweave/core/progress.h>
#include <mapweave/rawlog/observation_stream.h>

#include <string>
#include <vector>

namespace mapweave::rawlog {

struct SplitOptions {
  int robots = 2;
  double overlap_s = 0.0;
  std::vector<double>
      at_s;  // cuts, seconds as in the log; empty: parts of equal duration. Otherwise robots - 1 of them, rising
  ReadOptions reading;
};

struct SplitPart {
  std::filesystem::path path;  // <out folder>/robot<i>.rawlog; of a folder of pictures <out folder>/robot<i>
  Stamp first, last;           // of its observations; of a folder's part: of its frames
  std::uint64_t observations = 0, scans = 0, odometry = 0, frames = 0;  // frames: of cameras
};

// A folder of pictures becomes folders of the same layout: its pictures linked (or copied where they cannot be), its
// lists cut. Frames are cut by the stamps of their colour or left pictures; equal parts are so of the time from the
// first frame to the last. Stamps stay as they are; each part's odometry restarts at the origin. A part takes stamps in
// [cut before - overlap, next cut + overlap), the outer ones all there is. Throws Error: kUsage for cuts that do not
// fit the options, kBadInput for a cut outside the log or a part without observations, and whatever reading and writing
// throw; then no part is left behind. `out_folder` is made where it is missing.
std::vector<SplitPart> split_log(const std::filesystem::path& log, const std::filesystem::path& out_folder,
                                 const SplitOptions& options, Progress& progress);

// A ROS bag of several robots becomes a log of each, <out folder>/<namespace>.rawlog: namespaces that share a topic of
// odometry, else those that hold a laser, else those that hold a camera. Nothing is cut. Throws Error kBadInput for
// what is no bag, or has no such namespaces, and whatever reading and writing throw; then no part is left behind.
std::vector<SplitPart> split_by_namespace(const std::filesystem::path& bag, const std::filesystem::path& out_folder,
                                          const ReadOptions& options, Progress& progress);

}  // namespace mapweave::rawlog
