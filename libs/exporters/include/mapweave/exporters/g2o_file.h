#pragma once
// The pose graph of a map as g2o reads it: for g2o, GTSAM, Ceres' examples and other solvers.

#include <mapweave/maps/map.h>

#include <string>

namespace mapweave::exporters {

// VERTEX_SE2 and EDGE_SE2 where every pose and constraint is planar, else VERTEX_SE3:QUAT and EDGE_SE3:QUAT. Vertices
// are numbered from 0 in NodeId order; comments at the head say which session has which numbers. The first vertex is
// fixed. Numbers have all their digits. Priors, which g2o has other words for, are left out; a comment counts them.
// Of cameras' maps also PARAMS_CAMERACALIB (the camera on its robot), VERTEX_TRACKXYZ (landmarks that two keyframes or
// more saw) and EDGE_PROJECT_DISPARITY: pixel and inverse depth in 1/m, of which single cameras know nothing
// (information 0). Throws Error(kUnsupported) for constraints with a scale.
std::string g2o_text(const Map&);

}  // namespace mapweave::exporters
