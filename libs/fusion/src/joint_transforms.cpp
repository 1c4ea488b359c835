#include "joint_transforms.h"

#include <mapweave/core/error.h>
#include <coin/IpIpoptApplication.hpp>
#include <coin/IpTNLP.hpp>

#include <algorithm>
#include <cmath>
#include <mutex>

namespace mapweave::fusion {
namespace {

using Ipopt::Index;
using Ipopt::Number;
constexpr double kYawWeight_m2 = 25.0;  // a radian weighs as 5 m

// Variables: x, y, yaw of every map, then the switches. Minimises the squared errors of the joins, each times its switch squared, plus the
// price of switches below 1.
class Program : public Ipopt::TNLP {
 public:
  Program(std::size_t maps, const std::vector<Join>& joins, const std::vector<Pose2>& start) : maps_(maps), joins_(joins) {
    for (const auto& pose : start) values_.insert(values_.end(), {pose.x, pose.y, pose.phi});
    values_.insert(values_.end(), joins.size(), 1.0);
  }
  const std::vector<double>& values() const { return values_; }

  bool get_nlp_info(Index& n, Index& m, Index& jacobian, Index& hessian, IndexStyleEnum& style) override {
    n = static_cast<Index>(values_.size());
    m = 0, jacobian = 0, hessian = 0;
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
    value = evaluate(x, nullptr);
    return true;
  }
  bool eval_grad_f(Index n, const Number* x, bool, Number* gradient) override {
    std::fill(gradient, gradient + n, 0.0);
    evaluate(x, gradient);
    return true;
  }
  bool eval_g(Index, const Number*, bool, Index, Number*) override { return true; }
  bool eval_jac_g(Index, const Number*, bool, Index, Index, Index*, Index*, Number*) override { return true; }
  void finalize_solution(Ipopt::SolverReturn, Index n, const Number* x, const Number*, const Number*, Index, const Number*, const Number*,
                         Number, const Ipopt::IpoptData*, Ipopt::IpoptCalculatedQuantities*) override {
    values_.assign(x, x + n);
  }

 private:
  double evaluate(const Number* x, Number* gradient) const {
    double sum = 0.0;
    for (std::size_t k = 0; k < joins_.size(); ++k) {
      const Join& join = joins_[k];
      const Number *a = x + 3 * join.a, *b = x + 3 * join.b;
      const double s = x[3 * maps_ + k], ca = std::cos(a[2]), sa = std::sin(a[2]), cb = std::cos(b[2]), sb = std::sin(b[2]);
      double error = 0.0;
      for (const auto& term : join.terms) {
        const double ex = a[0] + ca * term.a_x - sa * term.a_y - (b[0] + cb * term.b_x - sb * term.b_y);
        const double ey = a[1] + sa * term.a_x + ca * term.a_y - (b[1] + sb * term.b_x + cb * term.b_y);
        // Of the turn, the chord: smooth everywhere.
        const double turn = b[2] - a[2] - term.yaw, chord = 2.0 - 2.0 * std::cos(turn);
        error += term.weight * (ex * ex + ey * ey + kYawWeight_m2 * chord);
        if (gradient == nullptr) continue;
        const double w = 2.0 * s * s * term.weight, bend = s * s * term.weight * kYawWeight_m2 * 2.0 * std::sin(turn);
        Number *ga = gradient + 3 * join.a, *gb = gradient + 3 * join.b;
        ga[0] += w * ex, ga[1] += w * ey;
        ga[2] += w * (ex * (-sa * term.a_x - ca * term.a_y) + ey * (ca * term.a_x - sa * term.a_y)) - bend;
        gb[0] -= w * ex, gb[1] -= w * ey;
        gb[2] -= w * (ex * (-sb * term.b_x - cb * term.b_y) + ey * (cb * term.b_x - sb * term.b_y)) - bend;
      }
      sum += s * s * error + join.strength * (1.0 - s) * (1.0 - s);
      if (gradient != nullptr) gradient[3 * maps_ + k] += 2.0 * s * error - 2.0 * join.strength * (1.0 - s);
    }
    return sum;
  }
  std::size_t maps_;
  const std::vector<Join>& joins_;
  std::vector<double> values_;
};

}  // namespace

JointTransforms solve_joint_transforms(std::size_t maps, const std::vector<Join>& joins, const std::vector<Pose2>& start) {
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
  application->Options()->SetStringValue("hessian_approximation", "limited-memory");
  application->Options()->SetStringValue("fixed_variable_treatment", "make_parameter");
  application->Options()->SetIntegerValue("max_iter", 500);
  application->Options()->SetNumericValue("tol", 1e-8);
  JointTransforms result;
  if (application->Initialize("") == Ipopt::Solve_Succeeded && maps > 1) {
    const auto status = application->OptimizeTNLP(program);
    result.converged = status == Ipopt::Solve_Succeeded || status == Ipopt::Solved_To_Acceptable_Level;
  }
  const auto& values = program->values();
  for (std::size_t i = 0; i < maps; ++i) result.team_from_map.push_back({values[3 * i], values[3 * i + 1], wrap_angle(values[3 * i + 2])});
  result.switches.assign(values.begin() + static_cast<std::ptrdiff_t>(3 * maps), values.end());
  return result;
}

}  // namespace mapweave::fusion
