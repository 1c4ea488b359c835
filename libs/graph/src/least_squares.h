#pragma once
// How graphs are solved by Ceres: sparse, by one thread, so that the same input gives the same bytes.

#include <ceres/ceres.h>

namespace mapweave::graph {

inline ceres::Solver::Summary minimised(
    ceres::Problem& problem, int iterations,
    double trust_region_radius = ceres::Solver::Options().initial_trust_region_radius) {
  ceres::Solver::Options options;
  options.linear_solver_type = ceres::SPARSE_NORMAL_CHOLESKY;
  options.sparse_linear_algebra_library_type = ceres::EIGEN_SPARSE;
  options.num_threads = 1;
  options.max_num_iterations = iterations;
  options.function_tolerance = 1e-7;
  options.parameter_tolerance = 1e-9;
  options.logging_type = ceres::SILENT;
  options.initial_trust_region_radius = trust_region_radius;
  ceres::Solver::Summary summary;
  ceres::Solve(options, &problem, &summary);
  return summary;
}

}  // namespace mapweave::graph
