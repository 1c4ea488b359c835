#pragma once
// The loop of every least squares problem here: Levenberg-Marquardt (Marquardt, An Algorithm for Least-Squares
// Estimation of Nonlinear Parameters, 1963). A `Problem` has
//   cost()             where it stands: the sum of squares
//   linearise()        there
//   try_step(damping)  where a damped step leads, and the cost there; nullopt where there is none
//   take_step()        to where the last try_step led

#include <algorithm>
#include <optional>

namespace mapweave::graph {

struct Damping {
  double first = 1e-4;
  double easier = 0.1, harder = 10.0;  // factors after a step that is taken, and after one that is not
  double least = 1e-10, most = 1e9;    // what needs more has nothing left to gain
};

struct Descent {
  double cost_before = 0.0, cost = 0.0;
  int iterations = 0;  // linearisations
  bool converged = false;
};

// Until a step saves no more than the share `enough` of the cost.
template <class Problem>
Descent descend(Problem& problem, int iterations, double enough, const Damping& damping) {
  Descent descent;
  descent.cost = descent.cost_before = problem.cost();
  double now = damping.first;
  while (descent.iterations < iterations && !descent.converged) {
    ++descent.iterations;
    problem.linearise();
    for (bool is_better = false; !is_better && !descent.converged;) {
      const std::optional<double> after = problem.try_step(now);
      is_better = after && *after < descent.cost;
      now = std::max(damping.least, now * (is_better ? damping.easier : damping.harder));
      descent.converged = is_better ? descent.cost - *after <= enough * descent.cost : now > damping.most;
      if (!is_better) continue;
      problem.take_step();
      descent.cost = *after;
    }
    constexpr double kNothing = 1e-20;
    descent.converged = descent.converged || descent.cost < kNothing;
  }
  return descent;
}

}  // namespace mapweave::graph
