#pragma once
// The problem of mapweave/graph/bundle_adjustment.h, handed to Ceres: an oracle, and what its time is compared with.
// Derivatives by hand; a view's small motion as ours, so that Ceres does not multiply by a manifold's slope in vain.
// Without relative-pose constraints, and without what is learnt of the sensor.

#include <mapweave/graph/bundle_adjustment.h>

#include <ceres/types.h>

namespace mapweave::graph {

// In place, but for what fits. One thread.
BundleReport adjust_by_ceres(Bundle& bundle, const BundleOptions& options, ceres::LinearSolverType solver);

}  // namespace mapweave::graph
