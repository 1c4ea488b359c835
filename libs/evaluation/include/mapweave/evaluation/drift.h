#pragma once
// Drift over long paths, as the KITTI odometry benchmark measures it (Geiger et al., CVPR 2012): pieces of 100, 200 ...
// 800 m of the reference's path, one beginning at every tenth pose.

#include <mapweave/evaluation/alignment.h>

#include <array>
#include <vector>

namespace mapweave::evaluation {

struct LengthDrift {
  double length_m = 0.0;
  std::size_t pieces = 0;
  double translation_percent = 0.0;  // mean of error / length
  double rotation_deg_per_m = 0.0;
};

struct Drift {
  LengthDrift all;                       // of pieces of any length; its length_m is 0
  std::array<LengthDrift, 8> by_length;  // 100 to 800 m; without pieces where no path is as long
};

// Of robots' tracks; no piece begins in one and ends in another. Asks for no alignment but its scale.
Drift drift(const std::vector<std::vector<PosePair>>& tracks);

}  // namespace mapweave::evaluation
