#include "joint_transforms.h"

#include <mapweave/core/error.h>
#include <coin/IpIpoptApplication.hpp>
#include <coin/IpTNLP.hpp>

#include <Eigen/Core>
#include <algorithm>
#include <array>
#include <cmath>
#include <mutex>

namespace mapweave::fusion {
namespace {

using Ipopt::Index;
using Ipopt::Number;
constexpr double kYawWeight_m2 = 25.0;  // a radian weighs as 5 m

// Variables: x, y, yaw of every map, then the switches. Minimises the squared errors of the joins, each times its
// switch squared, plus the price of switches below 1.
class Program : public Ipopt::TNLP {
 public:
  Program(std::size_t maps, const std::vector<Join>& joins, const std::vector<Pose2>& start)
      : maps_(maps), joins_(joins) {
    for (const auto& pose : start) values_.insert(values_.end(), {pose.x, pose.y, pose.phi});
    values_.insert(values_.end(), joins.size(), 1.0);
  }
  const std::vector<double>& values() const { return values_; }

  bool get_nlp_info(Index& n, Index& m, Index& jacobian, Index& hessian, IndexStyleEnum& style) override {
    n = static_cast<Index>(values_.size());
    m = 0;
    jacobian = 0;
    hessian = static_cast<Index>(kCurves * joins_.size());
    style = C_STYLE;
    return true;
  }
  bool get_bounds_info(Index n, Number* low, Number* high, Index, Number*, Number*) override {
    for (Index i = 0; i < n; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const bool is_switch = k >= 3 * maps_, gauge = k < 3;
      low[i] = is_switch ? 0.0 : gauge ? 0.0 : -1e19;
      high[i] = is_switch ? 1.0 : gauge ? 0.0 : 1e19;
    }
    return true;
  }
  bool get_starting_point(Index n, bool, Number* x, bool, Number*, Number*, Index, bool, Number*) override {
    std::copy(values_.begin(), values_.begin() + n, x);
    return true;
  }
  bool eval_f(Index, const Number* x, bool, Number& value) override {
    value = 0.0;
    for (std::size_t k = 0; k < joins_.size(); ++k) value += of_join(k, x).value;
    return true;
  }
  bool eval_grad_f(Index n, const Number* x, bool, Number* gradient) override {
    std::fill(gradient, gradient + n, 0.0);
    for (std::size_t k = 0; k < joins_.size(); ++k) {
      const OfJoin join = of_join(k, x);
      const std::array<std::size_t, 7> variables = variables_of(k);
      for (std::size_t i = 0; i < variables.size(); ++i) gradient[variables[i]] += join.slope(static_cast<Index>(i));
    }
    return true;
  }
  bool eval_g(Index, const Number*, bool, Index, Number*) override { return true; }
  bool eval_jac_g(Index, const Number*, bool, Index, Index, Index*, Index*, Number*) override { return true; }
  // Of Gauss and Newton, where poses are concerned; duplicates add up.
  bool eval_h(Index, const Number* x, bool, Number factor, Index, const Number*, bool, Index, Index* rows,
              Index* columns, Number* values) override {
    for (std::size_t k = 0, next = 0; k < joins_.size(); ++k, next += kCurves) {
      const std::array<std::size_t, 7> variables = variables_of(k);
      const OfJoin join = values != nullptr ? of_join(k, x) : OfJoin();
      for (std::size_t i = 0, entry = next; i < variables.size(); ++i)
        for (std::size_t j = 0; j <= i; ++j, ++entry) {
          if (values != nullptr) {
            values[entry] = factor * join.curve(static_cast<Index>(i), static_cast<Index>(j));
          } else {
            rows[entry] = static_cast<Index>(std::max(variables[i], variables[j]));
            columns[entry] = static_cast<Index>(std::min(variables[i], variables[j]));
          }
        }
    }
    return true;
  }
  void finalize_solution(Ipopt::SolverReturn, Index n, const Number* x, const Number*, const Number*, Index,
                         const Number*, const Number*, Number, const Ipopt::IpoptData*,
                         Ipopt::IpoptCalculatedQuantities*) override {
    values_.assign(x, x + n);
  }

 private:
  static constexpr std::size_t kCurves = 28;  // the lower half of 7 x 7: both poses and the switch

  std::array<std::size_t, 7> variables_of(std::size_t k) const {
    const std::size_t a = 3 * joins_[k].a, b = 3 * joins_[k].b;
    return {a, a + 1, a + 2, b, b + 1, b + 2, 3 * maps_ + k};
  }

  struct OfJoin {
    double value = 0.0;
    Eigen::Matrix<double, 7, 1> slope = Eigen::Matrix<double, 7, 1>::Zero();
    Eigen::Matrix<double, 7, 7> curve = Eigen::Matrix<double, 7, 7>::Zero();
  };
  OfJoin of_join(std::size_t k, const Number* x) const {
    const Join& join = joins_[k];
    const Number *a = x + 3 * join.a, *b = x + 3 * join.b;
    const double s = x[3 * maps_ + k], ca = std::cos(a[2]), sa = std::sin(a[2]), cb = std::cos(b[2]),
                 sb = std::sin(b[2]);
    double error = 0.0;
    Eigen::Matrix<double, 6, 1> slope = Eigen::Matrix<double, 6, 1>::Zero();
    Eigen::Matrix<double, 6, 6> curve = Eigen::Matrix<double, 6, 6>::Zero();
    for (const auto& term : join.terms) {
      const double pa_x = ca * term.a_x - sa * term.a_y, pa_y = sa * term.a_x + ca * term.a_y,
                   pb_x = cb * term.b_x - sb * term.b_y, pb_y = sb * term.b_x + cb * term.b_y;
      const double ex = a[0] + pa_x - (b[0] + pb_x), ey = a[1] + pa_y - (b[1] + pb_y);
      // Of the turn, the chord: smooth everywhere.
      const double turn = b[2] - a[2] - term.yaw, chord = 2.0 - 2.0 * std::cos(turn);
      error += term.weight * (ex * ex + ey * ey + kYawWeight_m2 * chord);
      Eigen::Matrix<double, 2, 6> moved;
      moved << 1, 0, -pa_y, -1, 0, pb_y, 0, 1, pa_x, 0, -1, -pb_x;
      slope += 2.0 * term.weight * moved.transpose() * Eigen::Vector2d(ex, ey);
      curve += 2.0 * term.weight * moved.transpose() * moved;
      const double bend = 2.0 * term.weight * kYawWeight_m2 * std::sin(turn),
                   bends = 2.0 * term.weight * kYawWeight_m2 * std::cos(turn);
      slope(2) -= bend;
      slope(5) += bend;
      curve(2, 2) += bends;
      curve(5, 5) += bends;
      curve(2, 5) -= bends;
      curve(5, 2) -= bends;
    }
    OfJoin result;
    result.value = s * s * error + join.strength * (1.0 - s) * (1.0 - s);
    result.slope << s * s * slope, 2.0 * s * error - 2.0 * join.strength * (1.0 - s);
    result.curve.topLeftCorner<6, 6>() = s * s * curve;
    result.curve.row(6).head<6>() = 2.0 * s * slope.transpose();
    result.curve.col(6).head<6>() = 2.0 * s * slope;
    result.curve(6, 6) = 2.0 * error + 2.0 * join.strength;
    return result;
  }

  std::size_t maps_;
  const std::vector<Join>& joins_;
  std::vector<double> values_;
};

}  // namespace

JointTransforms solve_joint_transforms(std::size_t maps, const std::vector<Join>& joins,
                                       const std::vector<Pose2>& start) {
  MAPWEAVE_EXPECT(start.size() == maps && maps >= 1, "every map has a starting pose");
  static std::mutex one_at_a_time;  // its linear solver keeps state in memory that all calls share
  const std::lock_guard lock(one_at_a_time);
  // The gauge: map 0 at the origin.
  std::vector<Pose2> relative;
  for (const auto& pose : start) relative.push_back(between(start.front(), pose));
  Ipopt::SmartPtr<Program> program = new Program(maps, joins, relative);
  Ipopt::SmartPtr<Ipopt::IpoptApplication> application = new Ipopt::IpoptApplication(false);
  application->Options()->SetIntegerValue("print_level", 0);
  application->Options()->SetStringValue("sb", "yes");
  application->Options()->SetStringValue("fixed_variable_treatment", "make_parameter");
  application->Options()->SetIntegerValue("max_iter", 500);
  application->Options()->SetNumericValue("tol", 1e-8);
  JointTransforms result;
  if (application->Initialize("") == Ipopt::Solve_Succeeded && maps > 1) {
    const auto status = application->OptimizeTNLP(program);
    result.converged = status == Ipopt::Solve_Succeeded || status == Ipopt::Solved_To_Acceptable_Level;
  }
  const auto& values = program->values();
  for (std::size_t i = 0; i < maps; ++i)
    result.team_from_map.push_back({values[3 * i], values[3 * i + 1], wrap_angle(values[3 * i + 2])});
  result.switches.assign(values.begin() + static_cast<std::ptrdiff_t>(3 * maps), values.end());
  return result;
}

}  // namespace mapweave::fusion
