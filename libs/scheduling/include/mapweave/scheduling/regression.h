#pragma once
// Linear least squares with coefficients of 0 or more, and how far to trust it: for times that grow with what was
// worked on.

#include <Eigen/Core>

#include <vector>

namespace mapweave::scheduling {

struct Regression {
  std::vector<double> coefficients;  // by basis function
  std::vector<double> residuals;     // measured minus fitted, by sample
  bool relative = false;             // fit_relative() made it
  double standard_error = 0.0;  // of a sample: root of the squared residuals over the degrees of freedom; 0 where there
                                // are none; relative: as a share of what was measured
  double r_squared = 0.0;       // share of the variance that is explained
  std::size_t degrees_of_freedom = 0;
  Eigen::MatrixXd inverse_normal;  // (X'X)^-1, relative: of rows over what was measured; zero in rows of coefficients
                                   // that are held at 0

  double at(const std::vector<double>& basis) const;
  // Half the width of the interval in which the next sample lies with this probability (Student's t); infinite without
  // degrees of freedom.
  double interval(const std::vector<double>& basis, double probability = 0.95) const;
};

// Rows of `basis` are samples. The best over all choices of which coefficients are held at 0 (so at most a handful of
// columns); none where the samples are fewer than what is left to determine.
Regression fit(const Eigen::MatrixXd& basis, const Eigen::VectorXd& measured);

// The same for what is spread over orders of magnitude: makes residuals least as shares of what was measured, so that
// short times count as long ones do. What is below a ten-thousandth of the largest sample counts as that.
Regression fit_relative(const Eigen::MatrixXd& basis, const Eigen::VectorXd& measured);

// Of Student's distribution: the t that a sample stays below with `probability` (0.5 to 1).
double student_quantile(double probability, std::size_t degrees_of_freedom);

}  // namespace mapweave::scheduling
