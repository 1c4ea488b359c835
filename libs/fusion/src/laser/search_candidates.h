#pragma once
// Pairs of submaps that are worth a question: where a solved graph says that they lie near each other, and does not
// know yet exactly how.

#include "submap_judge.h"

#include <functional>
#include <map>
#include <optional>

namespace mapweave::fusion {

constexpr double kSure_m = 0.7;                          // standard deviation up to which a window is narrow
constexpr double kWidest_m = 6.0, kWidestFinal_m = 1e3;  // and up to which a wide window is worth a search

// Standard deviation of a position along its least certain direction. Covariance: x, y, yaw.
double position_sigma(const Eigen::Matrix3d& covariance);

using SubmapsInScope = std::function<bool(std::size_t, std::size_t)>;

// What was asked before, by the numbers of the submaps, the lower first.
struct ExaminedWindow {
  Pose2 expected;
  double radius_m = 0.0;
};
using ExaminedPairs = std::map<std::pair<std::size_t, std::size_t>, ExaminedWindow>;

// Places are those of submaps in the solved graph.
class SearchCandidates {
 public:
  // All outlive it.
  SearchCandidates(const std::vector<PreparedMap>& maps, const SubmapGraph& graph, const SubmapsInScope& in_scope,
                   const SolvedSubmaps& solved, graph::RelativeCovariance& covariance, const ExaminedPairs& examined);

  // In narrow windows, where places are known to kSure_m.
  std::vector<SubmapQuestion> narrow() { return questions(0.0); }
  // In wide windows, where they are known to this and no better than to kSure_m.
  std::vector<SubmapQuestion> wide(double widest_m) { return questions(widest_m); }
  // Of each place those that look most like it, however far away the graph has them, if it may be so wrong: around
  // where their walls lie on each other, the most alike first.
  std::vector<SubmapQuestion> alike();
  // Whether a match may be right, though the graph expected something else.
  bool may_be(const SubmapMatch& match);

 private:
  // Another place, as one place sees it.
  struct Near {
    double distance, unlikeness;
    std::size_t place;
    double sigma_m, sigma_rad;
    bool operator<(const Near& other) const;
  };
  using ChosenPairs = std::map<std::pair<std::size_t, std::size_t>, const Near*>;  // by place, the lower first

  std::vector<SubmapQuestion> questions(double widest_m);
  std::vector<std::vector<Near>> all_near(double widest_m);
  std::optional<Near> near(std::size_t place, std::size_t of, double widest_m);
  matching::WideWindow window_on_each_other(std::size_t place, std::size_t of, double yaw_rad) const;
  double reach_m(std::size_t i, std::size_t j) const;
  double unlikeness(std::size_t i, std::size_t j) const;
  bool is_examined(std::size_t place, std::size_t of) const;
  static ChosenPairs chosen(std::vector<std::vector<Near>>& near, double widest_m);

  const std::vector<PreparedMap>& maps_;
  const SubmapGraph& graph_;
  const SubmapsInScope& in_scope_;
  const SolvedSubmaps& solved_;
  graph::RelativeCovariance& covariance_;
  const ExaminedPairs& examined_;
  std::vector<Eigen::Vector2d> middles_;  // of the submaps' walls
};

}  // namespace mapweave::fusion
