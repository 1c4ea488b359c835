#pragma once
// A picture of estimated trajectories and their references, for people.

#include <Eigen/Core>

#include <string>
#include <vector>

namespace mapweave::exporters {

struct PlottedPose {
  double stamp_s = 0.0;
  Eigen::Vector3d estimate, reference;  // metres, in one frame
};

struct PlottedTrack {
  std::string name;                // may be empty
  std::vector<PlottedPose> poses;  // by stamp
};

// PNG with three parts: the trajectories on their references, the trajectories coloured by their distance from them,
// and that distance over time. They are seen along the axis in which they extend least. Colours can be told apart by
// any colour vision, and the map of errors in black and white. Contract: there are tracks, each with poses, all finite.
std::string trajectory_plot_png(const std::vector<PlottedTrack>&, const std::string& title);

}  // namespace mapweave::exporters
