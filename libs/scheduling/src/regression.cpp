#include <mapweave/scheduling/regression.h>

#include <mapweave/core/error.h>

#include <Eigen/Dense>

#include <algorithm>
#include <cmath>
#include <limits>

namespace mapweave::scheduling {

namespace {

double explained(const Eigen::VectorXd& measured, const Eigen::VectorXd& residuals) {
  const double spread = measured.size() > 0 ? (measured.array() - measured.mean()).square().sum() : 0.0;
  return spread > 0.0 ? 1.0 - residuals.squaredNorm() / spread : 0.0;
}

}  // namespace

double Regression::at(const std::vector<double>& basis) const {
  MAPWEAVE_EXPECT(basis.size() == coefficients.size(), "one value for each coefficient");
  double sum = 0.0;
  for (std::size_t i = 0; i < basis.size(); ++i) sum += coefficients[i] * basis[i];
  return sum;
}

double Regression::interval(const std::vector<double>& basis, double probability) const {
  if (degrees_of_freedom == 0) return std::numeric_limits<double>::infinity();
  const Eigen::Map<const Eigen::VectorXd> x(basis.data(), static_cast<Eigen::Index>(basis.size()));
  const double noise = relative ? at(basis) : 1.0;
  return student_quantile(0.5 + 0.5 * probability, degrees_of_freedom) * standard_error *
         std::sqrt(noise * noise + x.dot(inverse_normal * x));
}

double student_quantile(double probability, std::size_t degrees_of_freedom) {
  MAPWEAVE_EXPECT(probability >= 0.5 && probability < 1.0 && degrees_of_freedom >= 1,
                  "a probability and degrees of freedom");
  // Bisection on the distribution, integrated by the exact finite series in theta = atan(t / sqrt(n)) (Abramowitz and
  // Stegun 26.7.3, 26.7.4).
  const auto n = degrees_of_freedom;
  const auto below = [n](double theta) {
    const double c = std::cos(theta), s = std::sin(theta);
    double term = n % 2 == 1 ? c : 1.0, sum = n == 1 ? 0.0 : term;
    for (std::size_t k = n % 2 == 1 ? 3 : 2; k + 1 < n + (n % 2 == 1 ? 0 : 1); k += 2) {
      term *= c * c * static_cast<double>(k - 1) / static_cast<double>(k);
      sum += term;
    }
    const double within = n % 2 == 1 ? 2.0 / M_PI * (theta + s * sum) : s * sum;
    return 0.5 + 0.5 * within;
  };
  double low = 0.0, high = M_PI_2;
  for (int i = 0; i < 100; ++i) {
    const double middle = 0.5 * (low + high);
    (below(middle) < probability ? low : high) = middle;
  }
  return std::tan(low) * std::sqrt(static_cast<double>(n));
}

Regression fit(const Eigen::MatrixXd& basis, const Eigen::VectorXd& measured) {
  const Eigen::Index columns = basis.cols(), rows = basis.rows();
  MAPWEAVE_EXPECT(rows == measured.size() && columns <= 8, "a row for each sample, few columns");
  Regression best;
  best.coefficients.assign(static_cast<std::size_t>(columns), 0.0);
  best.inverse_normal = Eigen::MatrixXd::Zero(columns, columns);
  const Eigen::VectorXd norms = basis.colwise().norm().transpose();  // columns of length 1 keep their digits
  Eigen::VectorXd left = measured;
  double least = measured.squaredNorm();
  for (unsigned choice = 1; choice < 1u << columns; ++choice) {
    std::vector<Eigen::Index> free;
    for (Eigen::Index i = 0; i < columns; ++i)
      if ((choice >> i & 1u) != 0) free.push_back(i);
    const bool nothing = std::any_of(free.begin(), free.end(), [&](Eigen::Index i) { return norms[i] == 0.0; });
    if (nothing || static_cast<Eigen::Index>(free.size()) > rows) continue;
    Eigen::MatrixXd part(rows, static_cast<Eigen::Index>(free.size()));
    for (std::size_t i = 0; i < free.size(); ++i)
      part.col(static_cast<Eigen::Index>(i)) = basis.col(free[i]) / norms[free[i]];
    const Eigen::ColPivHouseholderQR<Eigen::MatrixXd> solver(part);
    if (solver.rank() < part.cols()) continue;
    const Eigen::VectorXd found = solver.solve(measured), off = measured - part * found;
    constexpr double kWorthIt = 1e-9;  // of equals, the one with fewer coefficients
    if ((found.array() < 0.0).any() || off.squaredNorm() >= least - kWorthIt * measured.squaredNorm()) continue;
    least = off.squaredNorm();
    left = off;
    best.coefficients.assign(static_cast<std::size_t>(columns), 0.0);
    best.inverse_normal = Eigen::MatrixXd::Zero(columns, columns);
    const Eigen::MatrixXd inverse = (part.transpose() * part).inverse();
    for (std::size_t i = 0; i < free.size(); ++i) {
      best.coefficients[static_cast<std::size_t>(free[i])] = found[static_cast<Eigen::Index>(i)] / norms[free[i]];
      for (std::size_t j = 0; j < free.size(); ++j)
        best.inverse_normal(free[i], free[j]) =
            inverse(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j)) / (norms[free[i]] * norms[free[j]]);
    }
    best.degrees_of_freedom = static_cast<std::size_t>(rows) - free.size();
  }
  best.residuals.assign(left.data(), left.data() + left.size());
  if (best.degrees_of_freedom > 0)
    best.standard_error = std::sqrt(least / static_cast<double>(best.degrees_of_freedom));
  best.r_squared = explained(measured, left);
  return best;
}

Regression fit_relative(const Eigen::MatrixXd& basis, const Eigen::VectorXd& measured) {
  constexpr double kLeast = 1e-4;
  const double largest = measured.size() > 0 ? measured.maxCoeff() : 0.0;
  if (largest <= 0.0) return fit(basis, measured);
  const Eigen::VectorXd sizes = measured.cwiseMax(kLeast * largest);
  Regression found = fit(sizes.cwiseInverse().asDiagonal() * basis, measured.cwiseQuotient(sizes));
  found.relative = true;
  Eigen::Map<Eigen::VectorXd> residuals(found.residuals.data(), measured.size());
  residuals = residuals.cwiseProduct(sizes);
  found.r_squared = explained(measured, residuals);
  return found;
}

}  // namespace mapweave::scheduling
