// The relaxation behind lower_bound_seconds. A robot's weight w is its scans in units of their mean. With x the robots
// of a class at an edge, n their number and s their weight, y how far an edge is used, b its share of the bandwidth B
// of all edges, M the part of all scans that is on the fullest edge, T the time until the last edge map is in the cloud
// and C that of fusion there:
//
//   minimise  T + C
//   (classes)   sum_e x_ce = robots of class c, who have the same links and scans
//   (rooms)     n_e <= capacity_e y_e,  n_e >= y_e,  sum y >= the fewest edges that have room,  sum b <= 1
//   (mean)      sum w T >= sum x w t + sum_e s_e (fusion_e + delay) + sum_e least s_e^2 / (B b_e)
//   (edges)     T >= fastest_e y_e + fusion_e + delay y_e + smallest y_e^2 / (B b_e)
//   (fullest)   T >= what the fullest edge takes, were it the fastest
//   (cloud)     C >= what sum y edges have to share where all but one hold one of the smallest robots
//               C >= what edges that hold at most M have to share, were all used: sum of s_e^2 <= M sum of s_e
//   (bytes)     T >= the first edge's readiness + the bytes of all maps / B;  T >= what the slowest robot takes alone
//
// A plan has x and y of 0 or 1 and a robot is done when its edge is: (mean) is the weighted average of that over
// robots. Pairs on an edge are (s^2 - sum x w^2) / 2; in (mean), where they are multiplied by s, at least those of n
// robots of the least weight. What robots on an edge share is taken as nothing: a plan may part all that overlap. Where
// y is a fraction, terms are their perspectives: y f(s / y). Each is convex, so Ipopt's minimum is the minimum.

#include <mapweave/scheduling/placement.h>

#include <mapweave/core/log.h>

#include <coin/IpIpoptApplication.hpp>
#include <coin/IpTNLP.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <mutex>
#include <string>

namespace mapweave::scheduling {
namespace {

using Ipopt::Index;
using Ipopt::Number;
constexpr double kUnused = 1e-6;  // y and b of an edge that is not used
constexpr double kMoreRoom =
    1.0 + 1e-4;  // Ipopt searches within bounds, and where all rooms are full nothing is within

struct Relaxation {
  std::size_t edges = 0;
  double robots = 0.0, bandwidth = 0.0, least_bytes = 0.0, smallest_bytes = 0.0, least_seconds = 0.0;
  double least_weight = 0.0, weights = 0.0;           // of one robot, of all; least_bytes: by weight
  std::vector<double> count, weight;                  // by class
  std::vector<std::vector<double>> seconds;           // eq. 1, by class, by edge
  std::vector<double> fastest, speed, room, delay_s;  // by edge
  FusionTime edge_fusion;                             // by weight
  double fewest_edges = 1.0;                          // that have room for everyone
  double cloud_s = 0.0, cloud_s_per_edge = 0.0;       // with the fewest edges, and each further one
  double spread_s = 0.0,
         cloud_pairs_s = 0.0;  // cloud: spread_s where every robot is by itself, less cloud_pairs_s for all on one edge
  double full_s = 0.0, full_linear_s = 0.0, full_square_s = 0.0;  // of the fullest edge, by its share of all scans
};

// Robots with the same links and scans; where there are too many kinds, those of like scans by the least of each.
void add_classes(std::map<std::vector<double>, double>& kinds, Relaxation& result) {
  constexpr std::size_t kMostVariables = 2000;  // bounds the time of the solver; fewer kinds make the bound looser
  const std::size_t most = std::max<std::size_t>(1, std::min(kinds.size(), kMostVariables / result.edges));
  std::size_t index = 0;
  for (const auto& [kind, count] : kinds) {
    const std::size_t to = index++ * most / kinds.size();
    if (to == result.count.size()) {
      result.count.push_back(count);
      result.weight.push_back(kind.front());
      result.seconds.emplace_back(kind.begin() + 1, kind.end());
      continue;
    }
    result.count[to] += count;
    result.weight[to] = std::min(result.weight[to], kind.front());
    for (std::size_t e = 0; e < result.edges; ++e) result.seconds[to][e] = std::min(result.seconds[to][e], kind[e + 1]);
  }
  for (std::size_t c = 0; c < result.count.size(); ++c) result.weights += result.count[c] * result.weight[c];
}

// What is left to the cloud, whoever is where. The slowest of so many edges is no faster than the last of as many
// fastest ones.
void add_cloud(const FusionTime& time, const CloudResources& cloud, std::vector<double> scans, double shared,
               Relaxation& result) {
  std::vector<double> speeds = result.speed;
  std::sort(speeds.rbegin(), speeds.rend());
  const auto judges = [&](std::size_t used) {  // how many times as fast as the cloud so many edges are
    return cloud.edges_judge ? static_cast<double>(used) * speeds[used - 1] / cloud.speed : 1.0;
  };
  std::sort(scans.begin(), scans.end());
  double all = 0.0;
  for (const double one : scans) all += one;
  std::vector<double> rooms = result.room;
  std::sort(rooms.rbegin(), rooms.rend());
  double room = 0.0;
  std::size_t fewest = 0;
  while (fewest < rooms.size() && (room < result.robots || fewest == 0)) room += rooms[fewest++];
  const std::size_t most = std::max(fewest, std::min(result.edges, scans.size()));
  std::vector<double>
      shares;  // of pairs across edges, where so many edges and one more are used, as the cloud takes for them
  double alone = 0.0, pairs = 0.0, fastest = 0.0;
  for (std::size_t used = 1; used <= most; ++used) {
    if (used > 1 && used <= scans.size()) {
      alone += scans[used - 2];
      pairs += scans[used - 2] * (all - alone);
    }
    shares.push_back(pairs / judges(used));
    fastest = std::max(fastest, judges(used));
  }
  const double least = *std::min_element(shares.begin() + static_cast<std::ptrdiff_t>(fewest) - 1, shares.end());
  double slope = std::numeric_limits<double>::infinity();
  for (std::size_t used = fewest + 1; used <= most; ++used)
    slope = std::min(slope, (shares[used - 1] - least) / static_cast<double>(used - fewest));
  const double spread = 0.5 * all * all / fastest;
  result.fewest_edges = static_cast<double>(fewest);
  result.cloud_s = time.seconds({all, least, shared}) / cloud.speed;
  result.cloud_s_per_edge = std::isfinite(slope) ? time.per_scan_pair_s * slope / cloud.speed : 0.0;
  result.spread_s = time.seconds({all, spread, shared}) / cloud.speed;
  result.cloud_pairs_s = time.per_scan_pair_s * spread / cloud.speed;
}

// No edge fuses in less, whatever it has.
FusionTime least_fusion(const Latency& latency) {
  FusionTime least = latency.edge_fusion(0);
  for (std::uint32_t edge = 1; edge < latency.problem().edges.size(); ++edge) {
    const FusionTime& one = latency.edge_fusion(edge);
    least.fixed_s = std::min(least.fixed_s, one.fixed_s);
    least.per_scan_s = std::min(least.per_scan_s, one.per_scan_s);
    least.per_scan_pair_s = std::min(least.per_scan_pair_s, one.per_scan_pair_s);
  }
  return least;
}

double least_sent_bytes(const Latency& latency, std::uint32_t robot) {
  double least = latency.sent_bytes(robot, 0);
  for (std::uint32_t edge = 1; edge < latency.problem().edges.size(); ++edge)
    least = std::min(least, latency.sent_bytes(robot, edge));
  return least;
}

Relaxation relaxed(const Latency& latency) {
  const Problem& problem = latency.problem();
  const LatencyModel& model = latency.model();
  Relaxation result;
  const auto robots = static_cast<std::uint32_t>(problem.robots.size());
  result.edges = problem.edges.size();
  result.robots = robots;
  double highest_speed = 0.0, least_delay_s = std::numeric_limits<double>::infinity();
  for (std::uint32_t e = 0; e < problem.edges.size(); ++e) {
    const EdgeResources& edge = problem.edges[e];
    result.delay_s.push_back(latency.cloud_delay_s(e));
    least_delay_s = std::min(least_delay_s, result.delay_s.back());
    result.bandwidth += edge.bandwidth_bytes_per_s;
    highest_speed = std::max(highest_speed, edge.speed);
    result.speed.push_back(edge.speed);
    result.room.push_back(std::min<double>(robots, edge.capacity.value_or(robots)));
  }
  std::vector<double> scans;
  double all_scans = 0.0, most_scans = 0.0;
  for (std::uint32_t robot = 0; robot < robots; ++robot) {
    scans.push_back(latency.scans(robot));
    all_scans += scans.back();
    most_scans = std::max(most_scans, scans.back());
  }
  const double unit = all_scans > 0.0 ? all_scans / robots : 1.0;
  std::map<std::vector<double>, double> kinds;  // weight and seconds by edge
  result.fastest.assign(result.edges, std::numeric_limits<double>::infinity());
  double all_bytes = 0.0;
  result.least_bytes = result.smallest_bytes = result.least_weight = std::numeric_limits<double>::infinity();
  double first_ready = std::numeric_limits<double>::infinity();
  for (std::uint32_t robot = 0; robot < robots; ++robot) {
    const double weight = all_scans > 0.0 ? scans[robot] / unit : 1.0;
    std::vector<double> kind{weight};
    double alone = std::numeric_limits<double>::infinity();
    for (std::uint32_t edge = 0; edge < result.edges; ++edge) {
      kind.push_back(latency.robot_seconds(robot, edge));
      result.fastest[edge] = std::min(result.fastest[edge], kind.back());
      const double ready =
          kind.back() + latency.edge_fusion(edge).seconds({scans[robot], 0.0}) / problem.edges[edge].speed;
      first_ready = std::min(first_ready, ready);
      alone = std::min(alone, ready + latency.sent_bytes(robot, edge) / problem.edges[edge].bandwidth_bytes_per_s +
                                  result.delay_s[edge]);
    }
    result.least_seconds = std::max(result.least_seconds, alone);
    const double sent_bytes = least_sent_bytes(latency, robot);
    all_bytes += sent_bytes;
    result.least_weight = std::min(result.least_weight, weight);
    if (weight > 0.0) result.least_bytes = std::min(result.least_bytes, sent_bytes / weight);
    result.smallest_bytes = std::min(result.smallest_bytes, sent_bytes);
    kinds[std::move(kind)] += 1.0;
  }
  result.least_seconds = std::max(result.least_seconds, first_ready + all_bytes / result.bandwidth + least_delay_s);
  const FusionTime fusion = least_fusion(latency);
  result.edge_fusion = all_scans > 0.0
                           ? FusionTime{fusion.fixed_s, fusion.per_scan_s * unit, fusion.per_scan_pair_s * unit * unit}
                           : FusionTime{fusion.fixed_s, 0.0, 0.0};
  double first = std::numeric_limits<double>::infinity();
  for (std::size_t e = 0; e < result.edges; ++e) first = std::min(first, result.fastest[e] + result.delay_s[e]);
  result.full_s = first + fusion.fixed_s / highest_speed;
  result.full_linear_s = all_scans * (fusion.per_scan_s - 0.5 * fusion.per_scan_pair_s * most_scans) / highest_speed;
  result.full_square_s = 0.5 * fusion.per_scan_pair_s * all_scans * all_scans / highest_speed;
  add_classes(kinds, result);
  add_cloud(model.cloud_fusion, problem.cloud, std::move(scans), latency.shared_scans(), result);
  for (double& room : result.room) room *= kMoreRoom;
  return result;
}

// A convex function of one edge's n, s, y and b: value, gradient, lower half of the Hessian (nn, sn, ss, yn, ys, yy,
// bn, bs, by, bb).
struct OfEdge {
  double value;
  std::array<double, 4> slope;
  std::array<double, 10> curve;
};

// Variables: x class by class, n, s, y, b, then k (edges in use), M (share of all), C and T.
class Program : public Ipopt::TNLP {
 public:
  explicit Program(const Relaxation& relaxation) : r_(relaxation), edges_(r_.edges), classes_(r_.count.size()) {
    values_.assign(time() + 1, 0.0);
    double room = 0.0;
    for (const double one : r_.room) room += one;
    for (std::size_t e = 0; e < edges_; ++e) {
      for (std::size_t c = 0; c < classes_; ++c) values_[x(c, e)] = r_.count[c] * r_.room[e] / room;
      values_[n(e)] = r_.robots * r_.room[e] / room;
      values_[s(e)] = r_.weights * r_.room[e] / room;
      values_[y(e)] = std::max(kUnused, std::min({1.0, r_.room[e], values_[n(e)]}));
      values_[b(e)] = 1.0 / static_cast<double>(edges_);
      values_[used()] += values_[y(e)];
    }
    values_[used()] = std::max(values_[used()], r_.fewest_edges);
    values_[fullest()] = 1.0 / static_cast<double>(edges_);
    visit_slopes(values_.data(), [this](std::size_t row, std::size_t column, double) {
      row_.push_back(static_cast<Index>(row));
      column_.push_back(static_cast<Index>(column));
    });
    std::vector<double> start(rows());
    eval_g(0, values_.data(), true, 0, start.data());
    double time_needed = r_.least_seconds;
    for (std::size_t row = mean_row(); row < rows(); ++row) time_needed = std::max(time_needed, start[row]);
    values_[time()] = 1.1 * time_needed;  // the start is feasible
    values_[cloud()] = 1.1 * std::max({r_.cloud_s, start[cloud_row()], start[cloud_row() + 1]});
  }

  double objective() const { return values_[time()] + values_[cloud()]; }

  bool get_nlp_info(Index& variables, Index& constraints, Index& jacobian, Index& hessian,
                    IndexStyleEnum& style) override {
    variables = static_cast<Index>(values_.size());
    constraints = static_cast<Index>(rows());
    jacobian = static_cast<Index>(row_.size());
    hessian = static_cast<Index>(kCurves * edges_ + 1);
    style = C_STYLE;
    return true;
  }
  bool get_bounds_info(Index, Number* low, Number* high, Index, Number* row_low, Number* row_high) override {
    for (std::size_t e = 0; e < edges_; ++e) {
      for (std::size_t c = 0; c < classes_; ++c) {
        low[x(c, e)] = 0.0;
        high[x(c, e)] = std::min(r_.count[c] * kMoreRoom, r_.room[e]);
      }
      low[n(e)] = low[s(e)] = 0.0;
      high[n(e)] = r_.room[e];
      high[s(e)] = r_.weights * kMoreRoom;
      low[y(e)] = low[b(e)] = kUnused;
      high[y(e)] = high[b(e)] = 1.0;
    }
    low[used()] = r_.fewest_edges - 2.0 * kUnused * static_cast<double>(edges_);
    high[used()] = static_cast<double>(edges_);
    low[fullest()] = 0.0;
    high[fullest()] = 1.0;
    low[cloud()] = r_.cloud_s;
    low[time()] = r_.least_seconds;
    high[cloud()] = high[time()] = 1e19;
    std::fill(row_low, row_low + rows(), -1e19);
    std::fill(row_high, row_high + rows(), 0.0);
    for (std::size_t c = 0; c < classes_; ++c) row_low[c] = row_high[c] = r_.count[c];
    for (std::size_t e = 0; e < 2 * edges_; ++e) row_low[classes_ + e] = 0.0;
    row_low[used_row()] = 0.0;
    return true;
  }
  bool get_starting_point(Index count, bool, Number* start, bool, Number*, Number*, Index, bool, Number*) override {
    std::copy(values_.begin(), values_.begin() + count, start);
    return true;
  }
  bool eval_f(Index, const Number* at, bool, Number& value) override {
    value = at[time()] + at[cloud()];
    return true;
  }
  bool eval_grad_f(Index count, const Number*, bool, Number* gradient) override {
    std::fill(gradient, gradient + count, 0.0);
    gradient[time()] = gradient[cloud()] = 1.0;
    return true;
  }
  bool eval_g(Index, const Number* at, bool, Index, Number* g) override {
    std::fill(g, g + rows(), 0.0);
    g[used_row()] = -at[used()] - kUnused * static_cast<double>(edges_);
    g[used_row() + 1] = -1.0 - kUnused * static_cast<double>(edges_);
    g[mean_row()] = -at[time()];
    g[full_row()] =
        r_.full_s + r_.full_linear_s * at[fullest()] + r_.full_square_s * at[fullest()] * at[fullest()] - at[time()];
    g[cloud_row()] = r_.cloud_s + r_.cloud_s_per_edge * (at[used()] - r_.fewest_edges) - at[cloud()];
    g[cloud_row() + 1] = r_.spread_s - r_.cloud_pairs_s * at[fullest()] - at[cloud()];
    for (std::size_t e = 0; e < edges_; ++e) {
      g[classes_ + e] = -at[n(e)];
      g[classes_ + edges_ + e] = -at[s(e)];
      g[mean_row() + 1 + e] = alone(at, e).value - at[time()];
      for (std::size_t c = 0; c < classes_; ++c) {
        g[c] += at[x(c, e)];
        g[classes_ + e] += at[x(c, e)];
        g[classes_ + edges_ + e] += at[x(c, e)] * r_.weight[c];
        g[mean_row()] += at[x(c, e)] * of_robot_in_mean(c, e);
        g[mean_row() + 1 + e] += at[x(c, e)] * of_robot_alone(c, e);
      }
      g[classes_ + 2 * edges_ + e] = at[n(e)] - r_.room[e] * at[y(e)];
      g[classes_ + 3 * edges_ + e] = at[y(e)] - kUnused - at[n(e)];
      g[used_row()] += at[y(e)];
      g[used_row() + 1] += at[b(e)];
      g[mean_row()] += mean(at, e).value;
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
  bool eval_h(Index, const Number* at, bool, Number, Index, const Number* multipliers, bool, Index, Index* row,
              Index* column, Number* values) override {
    std::size_t next = 0;
    for (std::size_t e = 0; e < edges_; ++e) {
      const std::array<std::size_t, 4> variables = of_edge(e);
      if (values == nullptr) {
        for (std::size_t i = 0; i < variables.size(); ++i)
          for (std::size_t j = 0; j <= i; ++j, ++next) {
            row[next] = static_cast<Index>(variables[i]);
            column[next] = static_cast<Index>(variables[j]);
          }
        continue;
      }
      const auto of_mean = mean(at, e).curve, of_alone = alone(at, e).curve;
      for (std::size_t entry = 0; entry < kCurves; ++entry, ++next)
        values[next] = multipliers[mean_row()] * of_mean[entry] + multipliers[mean_row() + 1 + e] * of_alone[entry];
    }
    if (values == nullptr)
      row[next] = column[next] = static_cast<Index>(fullest());
    else
      values[next] = 2.0 * multipliers[full_row()] * r_.full_square_s;
    return true;
  }
  void finalize_solution(Ipopt::SolverReturn, Index count, const Number* at, const Number*, const Number*, Index,
                         const Number*, const Number*, Number, const Ipopt::IpoptData*,
                         Ipopt::IpoptCalculatedQuantities*) override {
    values_.assign(at, at + count);
  }

 private:
  static constexpr std::size_t kCurves = 10;  // second derivatives of each edge's terms that are not zero
  std::size_t x(std::size_t c, std::size_t e) const { return c * edges_ + e; }
  std::size_t n(std::size_t e) const { return classes_ * edges_ + e; }
  std::size_t s(std::size_t e) const { return (classes_ + 1) * edges_ + e; }
  std::size_t y(std::size_t e) const { return (classes_ + 2) * edges_ + e; }
  std::size_t b(std::size_t e) const { return (classes_ + 3) * edges_ + e; }
  std::array<std::size_t, 4> of_edge(std::size_t e) const { return {n(e), s(e), y(e), b(e)}; }
  std::size_t used() const { return (classes_ + 4) * edges_; }
  std::size_t fullest() const { return used() + 1; }
  std::size_t cloud() const { return used() + 2; }
  std::size_t time() const { return used() + 3; }
  std::size_t used_row() const { return classes_ + 4 * edges_; }  // then the shares of bandwidth
  std::size_t cloud_row() const { return used_row() + 2; }        // and the next
  std::size_t mean_row() const { return cloud_row() + 2; }        // then one for each edge alone
  std::size_t full_row() const { return mean_row() + 1 + edges_; }
  std::size_t rows() const { return full_row() + 1; }

  // What a robot of a class adds to (mean) and to its edge's own line beyond what n and s say.
  double of_robot_in_mean(std::size_t c, std::size_t e) const { return r_.weight[c] * r_.seconds[c][e] / r_.weights; }
  double of_robot_alone(std::size_t c, std::size_t e) const {
    return -0.5 * r_.edge_fusion.per_scan_pair_s / r_.speed[e] * r_.weight[c] * r_.weight[c];
  }
  // What (mean) says of an edge beyond x: s (fusion + delay) in perspective, and bytes; by the weight of all robots.
  OfEdge mean(const Number* at, std::size_t e) const {
    const double many = at[n(e)], heavy = at[s(e)], use = at[y(e)], share = at[b(e)], m = many / use, k = heavy / use,
                 speed = r_.speed[e] * r_.weights, bytes = r_.least_bytes / r_.bandwidth / r_.weights;
    const double start = r_.delay_s[e] / r_.weights + r_.edge_fusion.fixed_s / speed,
                 scan = r_.edge_fusion.per_scan_s / speed,
                 pair =
                     0.5 * r_.edge_fusion.per_scan_pair_s / speed * r_.least_weight * r_.least_weight * r_.least_weight;
    return {start * heavy + scan * heavy * k + pair * many * (m * m - m) + bytes * heavy * heavy / share,
            {pair * (3.0 * m * m - 2.0 * m), start + 2.0 * scan * k + 2.0 * bytes * heavy / share,
             -scan * k * k - pair * (2.0 * m * m * m - m * m), -bytes * heavy * heavy / (share * share)},
            {pair * (6.0 * m - 2.0) / use, 0.0, 2.0 * scan / use + 2.0 * bytes / share,
             -pair * (6.0 * m * m - 2.0 * m) / use, -2.0 * scan * k / use,
             (2.0 * scan * k * k + pair * (6.0 * m * m * m - 2.0 * m * m)) / use, 0.0,
             -2.0 * bytes * heavy / (share * share), 0.0, 2.0 * bytes * heavy * heavy / (share * share * share)}};
  }
  OfEdge alone(const Number* at, std::size_t e) const {
    const double heavy = at[s(e)], use = at[y(e)], share = at[b(e)], k = heavy / use, speed = r_.speed[e],
                 bytes = r_.smallest_bytes / r_.bandwidth;
    const double start = r_.fastest[e] + r_.delay_s[e] + r_.edge_fusion.fixed_s / speed,
                 scan = r_.edge_fusion.per_scan_s / speed, pair = 0.5 * r_.edge_fusion.per_scan_pair_s / speed;
    return {start * use + scan * heavy + pair * heavy * k + bytes * use * use / share,
            {0.0, scan + 2.0 * pair * k, start - pair * k * k + 2.0 * bytes * use / share,
             -bytes * use * use / (share * share)},
            {0.0, 0.0, 2.0 * pair / use, 0.0, -2.0 * pair * k / use, 2.0 * pair * k * k / use + 2.0 * bytes / share,
             0.0, 0.0, -2.0 * bytes * use / (share * share), 2.0 * bytes * use * use / (share * share * share)}};
  }

  // slope(row, variable, derivative), always for the same entries in the same order.
  template <class Slope>
  void visit_slopes(const Number* at, Slope slope) const {
    for (std::size_t e = 0; e < edges_; ++e) {
      for (std::size_t c = 0; c < classes_; ++c) {
        slope(c, x(c, e), 1.0);
        slope(classes_ + e, x(c, e), 1.0);
        slope(classes_ + edges_ + e, x(c, e), r_.weight[c]);
        slope(mean_row(), x(c, e), of_robot_in_mean(c, e));
        slope(mean_row() + 1 + e, x(c, e), of_robot_alone(c, e));
      }
      slope(classes_ + e, n(e), -1.0);
      slope(classes_ + edges_ + e, s(e), -1.0);
      slope(classes_ + 2 * edges_ + e, n(e), 1.0);
      slope(classes_ + 2 * edges_ + e, y(e), -r_.room[e]);
      slope(classes_ + 3 * edges_ + e, y(e), 1.0);
      slope(classes_ + 3 * edges_ + e, n(e), -1.0);
      slope(used_row(), y(e), 1.0);
      slope(used_row() + 1, b(e), 1.0);
      const auto of_mean = mean(at, e).slope, of_alone = alone(at, e).slope;
      const std::array<std::size_t, 4> variables = of_edge(e);
      for (std::size_t i = 0; i < variables.size(); ++i) {
        slope(mean_row(), variables[i], of_mean[i]);
        slope(mean_row() + 1 + e, variables[i], of_alone[i]);
      }
      slope(mean_row() + 1 + e, time(), -1.0);
    }
    slope(used_row(), used(), -1.0);
    slope(mean_row(), time(), -1.0);
    slope(full_row(), fullest(), r_.full_linear_s + 2.0 * r_.full_square_s * at[fullest()]);
    slope(full_row(), time(), -1.0);
    slope(cloud_row(), used(), r_.cloud_s_per_edge);
    slope(cloud_row(), cloud(), -1.0);
    slope(cloud_row() + 1, fullest(), -r_.cloud_pairs_s);
    slope(cloud_row() + 1, cloud(), -1.0);
  }

  const Relaxation& r_;
  std::size_t edges_, classes_;
  std::vector<double> values_;
  std::vector<Index> row_, column_;
};

}  // namespace

double lower_bound_seconds(const Latency& latency) {
  const Relaxation relaxation = relaxed(latency);
  const double simple = relaxation.least_seconds + relaxation.cloud_s;
  static std::mutex one_at_a_time;  // its linear solver keeps state in memory that all calls share
  const std::lock_guard lock(one_at_a_time);
  Ipopt::SmartPtr<Program> program = new Program(relaxation);
  Ipopt::SmartPtr<Ipopt::IpoptApplication> application = new Ipopt::IpoptApplication(false);
  application->Options()->SetIntegerValue("print_level", 0);
  application->Options()->SetStringValue("sb", "yes");
  application->Options()->SetIntegerValue("max_iter", 300);
  application->Options()->SetNumericValue("tol", 1e-7);
  Ipopt::ApplicationReturnStatus status = application->Initialize("");
  if (status == Ipopt::Solve_Succeeded) status = application->OptimizeTNLP(program);
  if (status != Ipopt::Solve_Succeeded) {
    log(LogLevel::warning,
        "the lower bound of a plan is a simpler one, for Ipopt ended with " + std::to_string(status));
    return simple;
  }
  constexpr double kMargin = 1e-5;  // what the solver's tolerance and kUnused may add
  return std::max(simple, program->objective() * (1.0 - kMargin));
}

}  // namespace mapweave::scheduling
