#include "ceres_bundle.h"

#include <ceres/ceres.h>

namespace mapweave::graph {
namespace {

// camera_from_map: a rotation column by column, then a translation. Slopes stand in the first six columns, as those of
// a small motion.
constexpr int kViewSize = 12;
using ViewSlope = Eigen::Matrix<double, kViewSize, 6, Eigen::RowMajor>;

class ViewManifold : public ceres::Manifold {
 public:
  int AmbientSize() const override { return kViewSize; }
  int TangentSize() const override { return 6; }
  bool Plus(const double* x, const double* motion, double* result) const override {
    const View view{Eigen::Map<const Eigen::Matrix3d>(x), Eigen::Map<const Eigen::Vector3d>(x + 9)};
    const View there = moved(view, Eigen::Map<const Eigen::Matrix<double, 6, 1>>(motion));
    Eigen::Map<Eigen::Matrix3d>{result} = there.rotation;
    Eigen::Map<Eigen::Vector3d>{result + 9} = there.translation;
    return true;
  }
  bool PlusJacobian(const double*, double* slope) const override {
    Eigen::Map<ViewSlope>{slope}.setIdentity();
    return true;
  }
  bool Minus(const double*, const double*, double*) const override { return false; }
  bool MinusJacobian(const double*, double*) const override { return false; }
};

// The pixel (two numbers) or the inverse depth (one).
template <int kSize>
class SightingCost : public ceres::SizedCostFunction<kSize, kViewSize, 3> {
 public:
  SightingCost(const BundleSighting& seen, const Pinhole& camera) : seen_(seen), camera_(camera) {}
  bool Evaluate(double const* const* at, double* value, double** slopes) const override {
    const Eigen::Map<const Eigen::Matrix3d> rotation(at[0]);
    const Eigen::Vector3d p =
        rotation * Eigen::Map<const Eigen::Vector3d>(at[1]) + Eigen::Map<const Eigen::Vector3d>(at[0] + 9);
    if (!(p.z() > 0.02)) return false;
    const double z = 1.0 / p.z();
    Eigen::Matrix<double, kSize, 3> by_p;
    if constexpr (kSize == 2) {
      Eigen::Map<Eigen::Vector2d>{value} = (camera_.project(p) - seen_.pixel) / seen_.sigma_px;
      by_p << camera_.fx * z, 0, -camera_.fx * p.x() * z * z, 0, camera_.fy * z, -camera_.fy * p.y() * z * z;
      by_p /= seen_.sigma_px;
    } else {
      value[0] = (z - seen_.inverse_depth) / seen_.inverse_depth_sigma;
      by_p << 0, 0, -z * z / seen_.inverse_depth_sigma;
    }
    if (slopes == nullptr) return true;
    if (slopes[0] != nullptr) {
      Eigen::Map<Eigen::Matrix<double, kSize, kViewSize, Eigen::RowMajor>> slope(slopes[0]);
      slope.setZero();
      slope.template leftCols<3>() = by_p;
      for (int row = 0; row < kSize; ++row)
        slope.template block<1, 3>(row, 3) = p.cross(by_p.row(row).transpose()).transpose();
    }
    if (slopes[1] != nullptr) Eigen::Map<Eigen::Matrix<double, kSize, 3, Eigen::RowMajor>>{slopes[1]} = by_p * rotation;
    return true;
  }

 private:
  BundleSighting seen_;
  Pinhole camera_;
};

}  // namespace

BundleReport adjust_by_ceres(Bundle& bundle, const BundleOptions& options, ceres::LinearSolverType solver) {
  std::vector<std::array<double, kViewSize>> views(bundle.views.size());
  for (std::size_t i = 0; i < views.size(); ++i) {
    Eigen::Map<Eigen::Matrix3d>{views[i].data()} = bundle.views[i].view.rotation;
    Eigen::Map<Eigen::Vector3d>{views[i].data() + 9} = bundle.views[i].view.translation;
  }
  ViewManifold manifold;
  ceres::HuberLoss loss(options.soft_sigmas);
  ceres::Problem::Options owning;
  owning.manifold_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  owning.loss_function_ownership = ceres::DO_NOT_TAKE_OWNERSHIP;
  owning.disable_all_safety_checks = true;
  ceres::Problem problem(owning);
  auto* order = new ceres::ParameterBlockOrdering;
  for (std::size_t i = 0; i < views.size(); ++i) {
    problem.AddParameterBlock(views[i].data(), kViewSize, &manifold);
    if (bundle.views[i].fixed) problem.SetParameterBlockConstant(views[i].data());
    order->AddElementToGroup(views[i].data(), 1);
  }
  for (Eigen::Vector3d& point : bundle.points) {
    problem.AddParameterBlock(point.data(), 3);
    order->AddElementToGroup(point.data(), 0);
  }
  for (const BundleSighting& seen : bundle.sightings) {
    if (!seen.fits) continue;
    const Pinhole& camera = bundle.cameras[bundle.views[seen.view].camera];
    double *const view = views[seen.view].data(), *const point = bundle.points[seen.point].data();
    problem.AddResidualBlock(new SightingCost<2>(seen, camera), &loss, view, point);
    if (seen.inverse_depth_sigma > 0.0) problem.AddResidualBlock(new SightingCost<1>(seen, camera), &loss, view, point);
  }
  ceres::Solver::Options solving;
  solving.linear_solver_type = solver;
  solving.sparse_linear_algebra_library_type = ceres::SUITE_SPARSE;
  solving.linear_solver_ordering.reset(order);
  solving.num_threads = 1;
  solving.max_num_iterations = options.iterations;
  solving.function_tolerance = options.least_gain;
  solving.logging_type = ceres::SILENT;
  ceres::Solver::Summary summary;
  ceres::Solve(solving, &problem, &summary);
  for (std::size_t i = 0; i < views.size(); ++i)
    bundle.views[i].view = {Eigen::Map<const Eigen::Matrix3d>(views[i].data()),
                            Eigen::Map<const Eigen::Vector3d>(views[i].data() + 9)};
  return {2.0 * summary.initial_cost, 2.0 * summary.final_cost,
          summary.num_successful_steps + summary.num_unsuccessful_steps - 1};
}

}  // namespace mapweave::graph
