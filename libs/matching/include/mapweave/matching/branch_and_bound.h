#pragma once
// All good alignments of one submap to another in a wide window, best first: branch and bound over a max-pyramid (after
// Hess et al., ICRA 2016, section IV; here with a decimated pyramid, and with every distinct peak instead of the best
// alone).

#include <mapweave/matching/submap_model.h>

#include <vector>

namespace mapweave::matching {

struct WideWindow {
  Pose2 a_from_b;          // middle of the window
  double radius_m = 10.0;  // of the centre of b's walls around where the middle puts it
  double yaw_rad = M_PI;   // either way; M_PI: all around
  bool known_part =
      false;  // narrow ones: only walls of b that a looked at, as the middle has it, are laid into a (judge)
};

struct SearchOptions {
  double min_score = 0.45;    // mean likelihood under b's query points, 0..1
  double rival_ratio = 0.80;  // peaks down to this share of the best are returned
  std::size_t most_peaks = 6;
  double peak_distance_m = 0.6;  // peaks nearer than this and
  double peak_yaw_rad = 0.20;    // turned less than this are one
  std::size_t budget = 3000000;  // nodes looked at
};

struct Peak {
  Pose2 a_from_b;
  double score = 0.0;
};

std::vector<Peak> search_peaks(const SubmapModel& a, const SubmapModel& b, const WideWindow&,
                               const SearchOptions& = {});

}  // namespace mapweave::matching
