// The relaxation behind lower_bound_seconds. With x the robots of a class at an edge, n their sum, y how far an edge is used, b its share
// of the bandwidth B of all edges and T the time until the last edge map is in the cloud:
//
//   minimise  T + cloud_fusion(sum y)
//   (classes)   sum_e x_ce = robots of class c                            robots with the same links and scans are a class
//   (rooms)     n_e <= capacity_e y_e,  n_e >= y_e,  sum y >= 1,  sum b <= 1
//   (mean)      robots T >= sum x t + sum_e n_e (fusion_e(n_e) + delay) + sum_e own n_e^2 / (B b_e)
//   (edges)     T >= fastest_e y_e + fusion_e(n_e) + delay y_e + smallest y_e^2 / (B b_e)
//   (bytes)     T >= the first edge's readiness + the bytes of one map of all / B;  T >= what the slowest robot takes alone
//
// A plan has x and y of 0 or 1 and a robot is done when its edge is: (mean) is the average of that over robots. Where y is a fraction,
// terms are their perspectives: y f(n / y). Each is convex, so Ipopt's minimum is the minimum.

#include <mapweave/scheduling/placement.h>

#include <coin/IpIpoptApplication.hpp>
#include <coin/IpTNLP.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <mutex>

namespace mapweave::scheduling {
namespace {

using Ipopt::Index;
using Ipopt::Number;
constexpr double kUnused = 1e-6;  // y and b of an edge that is not used

struct Relaxation {
  std::size_t edges = 0;
  double robots = 0.0, bandwidth = 0.0, least_own_bytes = 0.0, smallest_bytes = 0.0, least_seconds = 0.0, delay_s = 0.0;
  std::vector<double> count;                 // by class
  std::vector<std::vector<double>> seconds;  // eq. 1, by class, by edge
  std::vector<double> fastest, speed, room;  // by edge
  FusionTime edge_fusion, cloud_fusion;
};

Relaxation relaxed(const Latency& latency) {
  const Problem& problem = latency.problem();
  const LatencyModel& model = latency.model();
  Relaxation result;
  const auto robots = static_cast<std::uint32_t>(problem.robots.size());
  result.edges = problem.edges.size();
  result.robots = robots;
  result.edge_fusion = model.edge_fusion;
  result.cloud_fusion = model.cloud_fusion;
  result.delay_s = model.cloud_delay_s;
  double fastest_link = 0.0;
  for (const EdgeResources& edge : problem.edges) {
    result.bandwidth += edge.bandwidth_bytes_per_s;
    fastest_link = std::max(fastest_link, edge.bandwidth_bytes_per_s);
    result.speed.push_back(edge.speed);
    result.room.push_back(std::min<double>(robots, edge.capacity.value_or(robots)));
  }
  std::map<std::vector<double>, double> classes;
  std::vector<double> fastest(result.edges, std::numeric_limits<double>::infinity());
  double all_bytes = 0.0;
  result.least_own_bytes = result.smallest_bytes = std::numeric_limits<double>::infinity();
  double first_ready = std::numeric_limits<double>::infinity();
  for (std::uint32_t robot = 0; robot < robots; ++robot) {
    std::vector<double> seconds;
    double alone = std::numeric_limits<double>::infinity();
    for (std::uint32_t edge = 0; edge < result.edges; ++edge) {
      seconds.push_back(latency.robot_seconds(robot, edge));
      fastest[edge] = std::min(fastest[edge], seconds.back());
      const double ready = seconds.back() + model.edge_fusion.seconds(1.0) / problem.edges[edge].speed;
      first_ready = std::min(first_ready, ready);
      alone = std::min(alone, ready + latency.map_bytes(robot) / problem.edges[edge].bandwidth_bytes_per_s);
    }
    result.least_seconds = std::max(result.least_seconds, alone + model.cloud_delay_s);
    all_bytes += latency.own_bytes(robot);
    result.least_own_bytes = std::min(result.least_own_bytes, latency.own_bytes(robot));
    result.smallest_bytes = std::min(result.smallest_bytes, latency.map_bytes(robot));
    classes[std::move(seconds)] += 1.0;
  }
  result.least_seconds = std::max(result.least_seconds, first_ready + all_bytes / result.bandwidth + model.cloud_delay_s);
  result.fastest = fastest;
  constexpr std::size_t kMostVariables = 2000;
  if (classes.size() * result.edges <= kMostVariables) {
    for (const auto& [seconds, count] : classes) {
      result.seconds.push_back(seconds);
      result.count.push_back(count);
    }
  } else {  // one class of the fastest
    result.seconds.push_back(fastest);
    result.count.push_back(robots);
  }
  return result;
}

// A convex function of one edge's n, y and b: value, gradient, lower half of the Hessian (nn, yn, yy, bn, by, bb).
struct OfEdge {
  double value;
  std::array<double, 3> slope;
  std::array<double, 6> curve;
};

// Variables: x class by class, n, y, b, then k (edges in use) and T.
class Program : public Ipopt::TNLP {
 public:
  explicit Program(const Relaxation& relaxation) : r_(relaxation), edges_(r_.edges), classes_(r_.count.size()) {
    values_.assign(time() + 1, 0.0);
    double room = 0.0;
    for (const double one : r_.room) room += one;
    for (std::size_t e = 0; e < edges_; ++e) {
      for (std::size_t c = 0; c < classes_; ++c) values_[x(c, e)] = r_.count[c] * r_.room[e] / room;
      values_[n(e)] = r_.robots * r_.room[e] / room;
      values_[y(e)] = std::min({1.0, r_.room[e], values_[n(e)]});
      values_[b(e)] = 1.0 / static_cast<double>(edges_);
      values_[used()] += values_[y(e)];
    }
    visit_slopes(values_.data(), [this](std::size_t row, std::size_t column, double) {
      row_.push_back(static_cast<Index>(row));
      column_.push_back(static_cast<Index>(column));
    });
    std::vector<double> start(rows());
    eval_g(0, values_.data(), true, 0, start.data());
    double time_needed = r_.least_seconds;
    for (std::size_t row = mean_row(); row < rows(); ++row) time_needed = std::max(time_needed, start[row]);
    values_[time()] = 1.1 * time_needed;  // the start is feasible
  }

  double objective() const { return values_[time()] + r_.cloud_fusion.seconds(values_[used()]); }

  bool get_nlp_info(Index& variables, Index& constraints, Index& jacobian, Index& hessian, IndexStyleEnum& style) override {
    variables = static_cast<Index>(values_.size());
    constraints = static_cast<Index>(rows());
    jacobian = static_cast<Index>(row_.size());
    hessian = static_cast<Index>(6 * edges_ + 1);
    style = C_STYLE;
    return true;
  }
  bool get_bounds_info(Index, Number* low, Number* high, Index, Number* row_low, Number* row_high) override {
    for (std::size_t e = 0; e < edges_; ++e) {
      for (std::size_t c = 0; c < classes_; ++c) {
        low[x(c, e)] = 0.0;
        high[x(c, e)] = std::min(r_.count[c], r_.room[e]);
      }
      low[n(e)] = 0.0;
      high[n(e)] = r_.room[e];
      low[y(e)] = low[b(e)] = kUnused;
      high[y(e)] = high[b(e)] = 1.0;
    }
    low[used()] = 1.0;
    high[used()] = static_cast<double>(edges_);
    low[time()] = r_.least_seconds;
    high[time()] = 1e19;
    std::fill(row_low, row_low + rows(), -1e19);
    std::fill(row_high, row_high + rows(), 0.0);
    for (std::size_t c = 0; c < classes_; ++c) row_low[c] = row_high[c] = r_.count[c];
    for (std::size_t e = 0; e < edges_; ++e) row_low[classes_ + e] = 0.0;
    row_low[used_row()] = 0.0;
    return true;
  }
  bool get_starting_point(Index count, bool, Number* start, bool, Number*, Number*, Index, bool, Number*) override {
    std::copy(values_.begin(), values_.begin() + count, start);
    return true;
  }
  bool eval_f(Index, const Number* at, bool, Number& value) override {
    value = at[time()] + r_.cloud_fusion.seconds(at[used()]);
    return true;
  }
  bool eval_grad_f(Index count, const Number* at, bool, Number* gradient) override {
    std::fill(gradient, gradient + count, 0.0);
    gradient[time()] = 1.0;
    gradient[used()] = r_.cloud_fusion.per_map_s + r_.cloud_fusion.per_pair_s * (at[used()] - 0.5);
    return true;
  }
  bool eval_g(Index, const Number* at, bool, Index, Number* g) override {
    std::fill(g, g + rows(), 0.0);
    g[used_row()] = -at[used()] - kUnused * static_cast<double>(edges_);
    g[used_row() + 1] = -1.0 - kUnused * static_cast<double>(edges_);
    g[mean_row()] = -at[time()];
    for (std::size_t e = 0; e < edges_; ++e) {
      g[classes_ + e] = -at[n(e)];
      for (std::size_t c = 0; c < classes_; ++c) {
        g[c] += at[x(c, e)];
        g[classes_ + e] += at[x(c, e)];
        g[mean_row()] += at[x(c, e)] * r_.seconds[c][e] / r_.robots;
      }
      g[classes_ + edges_ + e] = at[n(e)] - r_.room[e] * at[y(e)];
      g[classes_ + 2 * edges_ + e] = at[y(e)] - kUnused - at[n(e)];
      g[used_row()] += at[y(e)];
      g[used_row() + 1] += at[b(e)];
      g[mean_row()] += mean(at, e).value;
      g[mean_row() + 1 + e] = alone(at, e).value - at[time()];
    }
    return true;
  }
  bool eval_jac_g(Index, const Number* at, bool, Index, Index, Index* row, Index* column, Number* values) override {
    if (values == nullptr) {
      std::copy(row_.begin(), row_.end(), row);
      std::copy(column_.begin(), column_.end(), column);
    } else {
      visit_slopes(at, [&values](std::size_t, std::size_t, double value) { *values++ = value; });
    }
    return true;
  }
  bool eval_h(Index, const Number* at, bool, Number weight, Index, const Number* multipliers, bool, Index, Index* row, Index* column,
              Number* values) override {
    std::size_t next = 0;
    for (std::size_t e = 0; e < edges_; ++e) {
      const std::array<std::size_t, 3> variables{n(e), y(e), b(e)};
      for (std::size_t i = 0, entry = 0; i < 3; ++i)
        for (std::size_t j = 0; j <= i; ++j, ++entry, ++next) {
          if (values == nullptr) {
            row[next] = static_cast<Index>(variables[i]);
            column[next] = static_cast<Index>(variables[j]);
          } else {
            values[next] = multipliers[mean_row()] * mean(at, e).curve[entry] + multipliers[mean_row() + 1 + e] * alone(at, e).curve[entry];
          }
        }
    }
    if (values == nullptr)
      row[next] = column[next] = static_cast<Index>(used());
    else
      values[next] = weight * r_.cloud_fusion.per_pair_s;
    return true;
  }
  void finalize_solution(Ipopt::SolverReturn, Index count, const Number* at, const Number*, const Number*, Index, const Number*,
                         const Number*, Number, const Ipopt::IpoptData*, Ipopt::IpoptCalculatedQuantities*) override {
    values_.assign(at, at + count);
  }

 private:
  std::size_t x(std::size_t c, std::size_t e) const { return c * edges_ + e; }
  std::size_t n(std::size_t e) const { return classes_ * edges_ + e; }
  std::size_t y(std::size_t e) const { return (classes_ + 1) * edges_ + e; }
  std::size_t b(std::size_t e) const { return (classes_ + 2) * edges_ + e; }
  std::size_t used() const { return (classes_ + 3) * edges_; }
  std::size_t time() const { return used() + 1; }
  std::size_t used_row() const { return classes_ + 3 * edges_; }  // then the shares of bandwidth
  std::size_t mean_row() const { return used_row() + 2; }         // then one for each edge alone
  std::size_t rows() const { return mean_row() + 1 + edges_; }

  // What (mean) says of an edge beyond x: n (fusion(n) + delay) in perspective, and bytes; over all robots.
  OfEdge mean(const Number* at, std::size_t e) const {
    const double many = at[n(e)], use = at[y(e)], share = at[b(e)], m = many / use, speed = r_.speed[e] * r_.robots,
                 bytes = r_.least_own_bytes / r_.bandwidth / r_.robots;
    const double fixed = r_.edge_fusion.fixed_s / speed, map = r_.edge_fusion.per_map_s / speed,
                 pair = 0.5 * r_.edge_fusion.per_pair_s / speed;
    return {many * r_.delay_s / r_.robots + fixed * many + map * many * m + pair * many * (m * m - m) + bytes * many * many / share,
            {r_.delay_s / r_.robots + fixed + 2.0 * map * m + pair * (3.0 * m * m - 2.0 * m) + 2.0 * bytes * many / share,
             -map * m * m - pair * (2.0 * m * m * m - m * m), -bytes * many * many / (share * share)},
            {(2.0 * map + pair * (6.0 * m - 2.0)) / use + 2.0 * bytes / share, (-2.0 * map * m - pair * (6.0 * m * m - 2.0 * m)) / use,
             (2.0 * map * m * m + pair * (6.0 * m * m * m - 2.0 * m * m)) / use, -2.0 * bytes * many / (share * share), 0.0,
             2.0 * bytes * many * many / (share * share * share)}};
  }
  OfEdge alone(const Number* at, std::size_t e) const {
    const double many = at[n(e)], use = at[y(e)], share = at[b(e)], m = many / use, speed = r_.speed[e],
                 bytes = r_.smallest_bytes / r_.bandwidth;
    const double start = r_.fastest[e] + r_.delay_s + r_.edge_fusion.fixed_s / speed, map = r_.edge_fusion.per_map_s / speed,
                 pair = 0.5 * r_.edge_fusion.per_pair_s / speed;
    return {start * use + map * many + pair * (many * m - many) + bytes * use * use / share,
            {map + pair * (2.0 * m - 1.0), start - pair * m * m + 2.0 * bytes * use / share, -bytes * use * use / (share * share)},
            {2.0 * pair / use, -2.0 * pair * m / use, 2.0 * pair * m * m / use + 2.0 * bytes / share, 0.0,
             -2.0 * bytes * use / (share * share), 2.0 * bytes * use * use / (share * share * share)}};
  }

  // slope(row, variable, derivative), always for the same entries in the same order.
  template <class Slope>
  void visit_slopes(const Number* at, Slope slope) const {
    for (std::size_t e = 0; e < edges_; ++e) {
      for (std::size_t c = 0; c < classes_; ++c) {
        slope(c, x(c, e), 1.0);
        slope(classes_ + e, x(c, e), 1.0);
        slope(mean_row(), x(c, e), r_.seconds[c][e] / r_.robots);
      }
      slope(classes_ + e, n(e), -1.0);
      slope(classes_ + edges_ + e, n(e), 1.0);
      slope(classes_ + edges_ + e, y(e), -r_.room[e]);
      slope(classes_ + 2 * edges_ + e, y(e), 1.0);
      slope(classes_ + 2 * edges_ + e, n(e), -1.0);
      slope(used_row(), y(e), 1.0);
      slope(used_row() + 1, b(e), 1.0);
      const auto of_mean = mean(at, e).slope, of_alone = alone(at, e).slope;
      for (std::size_t i = 0; i < 3; ++i) {
        const std::size_t variable = i == 0 ? n(e) : i == 1 ? y(e) : b(e);
        slope(mean_row(), variable, of_mean[i]);
        slope(mean_row() + 1 + e, variable, of_alone[i]);
      }
      slope(mean_row() + 1 + e, time(), -1.0);
    }
    slope(used_row(), used(), -1.0);
    slope(mean_row(), time(), -1.0);
  }

  const Relaxation& r_;
  std::size_t edges_, classes_;
  std::vector<double> values_;
  std::vector<Index> row_, column_;
};

}  // namespace

double lower_bound_seconds(const Latency& latency) {
  const Relaxation relaxation = relaxed(latency);
  const double simple = relaxation.least_seconds + relaxation.cloud_fusion.seconds(1.0);
  static std::mutex one_at_a_time;  // its linear solver keeps state in memory that all calls share
  const std::lock_guard lock(one_at_a_time);
  Ipopt::SmartPtr<Program> program = new Program(relaxation);
  Ipopt::SmartPtr<Ipopt::IpoptApplication> application = new Ipopt::IpoptApplication(false);
  application->Options()->SetIntegerValue("print_level", 0);
  application->Options()->SetStringValue("sb", "yes");
  application->Options()->SetIntegerValue("max_iter", 300);
  application->Options()->SetNumericValue("tol", 1e-7);
  if (application->Initialize("") != Ipopt::Solve_Succeeded || application->OptimizeTNLP(program) != Ipopt::Solve_Succeeded) return simple;
  constexpr double kMargin = 1e-5;  // what the solver's tolerance and kUnused may add
  return std::max(simple, program->objective() * (1.0 - kMargin));
}

}  // namespace mapweave::scheduling
