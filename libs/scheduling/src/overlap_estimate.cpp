#include "summary_cells.h"

#include <mapweave/scheduling/overlap_estimate.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <set>
#include <tuple>

namespace mapweave::scheduling {
namespace {

using Cell = MapSummary::Cell;

// Of walls of one map laid on another.
struct Agreement {
  int walls = 0, contradictions = 0, known = 0;
  // A wall that lies on free space outweighs two and a half that lie on walls: doors and noise make a few, another
  // place makes many.
  int score() const { return walls - 5 * contradictions; }
};

// b's walls on a's cells: 2 on a wall, 1 beside one.
Agreement agreement(const MapSummary& a, const std::vector<CellPoint>& walls_of_b, const Pose2& a_from_b) {
  Agreement result;
  const double c = std::cos(a_from_b.phi), s = std::sin(a_from_b.phi);
  for (const CellPoint& wall : walls_of_b) {
    const std::int32_t column = cell_of(a_from_b.x + c * wall.x - s * wall.y),
                       row = cell_of(a_from_b.y + s * wall.x + c * wall.y);
    const Cell there = a.at(column, row);
    if (there == Cell::unknown) continue;
    ++result.known;
    if (there == Cell::wall) {
      result.walls += 2;
    } else if (a.at(column + 1, row) == Cell::wall || a.at(column - 1, row) == Cell::wall ||
               a.at(column, row + 1) == Cell::wall || a.at(column, row - 1) == Cell::wall) {
      ++result.walls;
    } else {
      ++result.contradictions;
    }
  }
  return result;
}

int distance(const MapSummary::Look& a, const MapSummary::Look& b) {
  int sum = 0;
  for (std::size_t ring = 0; ring < a.walls.size(); ++ring) sum += std::abs(int{a.walls[ring]} - int{b.walls[ring]});
  return sum;
}

// What a knows and b does not.
std::size_t unlike_cells(const MapSummary& a, const MapSummary& b) {
  std::size_t count = 0;
  for (std::int32_t row = a.bottom; row < a.bottom + a.rows; ++row)
    for (std::int32_t column = a.left; column < a.left + a.columns; ++column)
      count += a.at(column, row) != Cell::unknown && b.at(column, row) == Cell::unknown;
  return count;
}

struct Guess {
  int score;
  Pose2 a_from_b;
};

// The best few of what follows from viewpoints that look alike.
std::vector<Guess> guesses_of(const MapSummary& a, const MapSummary& b, const std::vector<CellPoint>& walls_of_b) {
  using Pair = std::tuple<int, std::size_t, std::size_t>;  // distance, looks
  std::vector<Pair> pairs;
  for (std::size_t i = 0; i < a.looks.size(); ++i)
    for (std::size_t j = 0; j < b.looks.size(); ++j) pairs.emplace_back(distance(a.looks[i], b.looks[j]), i, j);
  // Pairs of viewpoints, and guesses that are refined with all walls: more find pairs that look less alike, and take
  // longer in proportion (15 to 50 ms a pair of maps as it is; DECISIONS.md, 44).
  constexpr std::size_t kTried = 24, kKept = 6;
  const std::size_t tried = std::min(kTried, pairs.size());
  std::partial_sort(pairs.begin(), pairs.begin() + static_cast<std::ptrdiff_t>(tried), pairs.end());
  std::vector<Guess> guesses;
  constexpr int kHeadings = 60;      // 6 degrees apart: refine() begins with half of that
  constexpr double kShift_m = 0.75;  // a ring: viewpoints that look alike lie about so near to each other
  for (std::size_t i = 0; i < tried; ++i) {
    const MapSummary::Look &to = a.looks[std::get<1>(pairs[i])], &from = b.looks[std::get<2>(pairs[i])];
    Guess best{0, {}};
    for (int heading = 0; heading < kHeadings; ++heading) {
      const double phi = wrap_angle(2.0 * M_PI * heading / kHeadings), c = std::cos(phi), s = std::sin(phi);
      const double x = 0.01 * (to.x_cm - c * from.x_cm + s * from.y_cm),
                   y = 0.01 * (to.y_cm - s * from.x_cm - c * from.y_cm);
      for (int shift = 0; shift < 9; ++shift) {
        const Pose2 pose{x + (shift % 3 - 1) * kShift_m, y + (shift / 3 - 1) * kShift_m, phi};
        if (const int score = agreement(a, walls_of_b, pose).score(); score > best.score) best = {score, pose};
      }
    }
    if (best.score > 0) guesses.push_back(best);
  }
  std::stable_sort(guesses.begin(), guesses.end(),
                   [](const Guess& one, const Guess& other) { return one.score > other.score; });
  guesses.resize(std::min(kKept, guesses.size()));
  return guesses;
}

// Uphill, by ever smaller steps.
void refine(const MapSummary& a, const std::vector<CellPoint>& walls_of_b, Guess& guess) {
  guess.score = agreement(a, walls_of_b, guess.a_from_b).score();
  // From two cells, and half of what guesses are turned apart, down to half a cell, below which cells tell nothing.
  for (double step_m = 0.5, step_rad = 0.05; step_m > 0.1; step_m *= 0.5, step_rad *= 0.5)
    for (bool is_better = true; is_better;) {
      is_better = false;
      const Pose2 around = guess.a_from_b;
      for (int step = 0; step < 27; ++step) {
        const Pose2 pose{around.x + (step % 3 - 1) * step_m, around.y + (step / 3 % 3 - 1) * step_m,
                         wrap_angle(around.phi + (step / 9 - 1) * step_rad)};
        if (const int score = agreement(a, walls_of_b, pose).score(); score > guess.score) {
          guess = {score, pose};
          is_better = true;
        }
      }
    }
}

}  // namespace

double overlap_degree(const MapSummary& a, const MapSummary& b, const Pose2& a_from_b) {
  const std::size_t all = a.known() + b.known();
  if (all == 0) return 0.0;
  std::size_t both = 0;
  const double c = std::cos(a_from_b.phi), s = std::sin(a_from_b.phi);
  for (std::int32_t row = 0; row < b.rows; ++row)
    for (std::int32_t column = 0; column < b.columns; ++column) {
      if (b.at(b.left + column, b.bottom + row) == Cell::unknown) continue;
      const double x = (b.left + column + 0.5) * MapSummary::kCell_m, y = (b.bottom + row + 0.5) * MapSummary::kCell_m;
      both += a.at(cell_of(a_from_b.x + c * x - s * y), cell_of(a_from_b.y + s * x + c * y)) != Cell::unknown;
    }
  return std::min(0.5, static_cast<double>(both) / static_cast<double>(all));
}

std::optional<EstimatedOverlap> estimate_overlap(const MapSummary& a, const MapSummary& b) {
  if (a.is_in_team_frame && b.is_in_team_frame) {
    const double degree = overlap_degree(a, b, {});
    return degree > 0.0 ? std::optional(EstimatedOverlap{{}, degree}) : std::nullopt;
  }
  if (a.is_in_team_frame != b.is_in_team_frame) return std::nullopt;  // a route that is only announced shows no walls
  const std::vector<CellPoint> walls = walls_of(b);
  std::vector<CellPoint> some;       // spread evenly
  constexpr std::size_t kSome = 60;  // walls that stand for all while headings and shifts are tried: bounds the time
  for (std::size_t i = 0; i < std::min(kSome, walls.size()); ++i)
    some.push_back(walls[i * walls.size() / std::min(kSome, walls.size())]);
  std::vector<Guess> guesses = guesses_of(a, b, some);
  Guess best{0, {}};
  for (Guess& guess : guesses) {
    refine(a, walls, guess);
    if (guess.score > best.score) best = guess;
  }
  const Agreement found = agreement(a, walls, best.a_from_b);
  constexpr int kLeastWalls = 24;  // twelve cells that coincide, or three metres; up to twice as many that lie beside
  constexpr double kMostContradicting = 0.08;  // of the walls that fall on what is known (DECISIONS.md, 44)
  if (best.score <= 0 || found.walls < kLeastWalls || found.contradictions > kMostContradicting * found.known)
    return std::nullopt;
  return EstimatedOverlap{best.a_from_b, overlap_degree(a, b, best.a_from_b)};
}

void OverlapEstimator::put(const RobotId& robot, MapSummary summary) {
  if (summary.known() == 0) return remove(robot);
  Entry& entry = maps_[robot];
  constexpr double kChanged = 0.1;  // of the cells that were compared: less hardly changes an overlap degree
  entry.is_stale = entry.is_stale || entry.compared.is_in_team_frame != summary.is_in_team_frame ||
                   static_cast<double>(unlike_cells(entry.compared, summary) + unlike_cells(summary, entry.compared)) >
                       kChanged * static_cast<double>(entry.compared.known());
  entry.summary = std::move(summary);
}

// Up to a few dozen maps all pairs; of more, for each map those that share most words. A word is how many walls stand
// near, farther and far.
std::vector<std::pair<RobotId, RobotId>> OverlapEstimator::candidates() const {
  std::vector<std::pair<RobotId, RobotId>> pairs;
  // Of 24 maps there are 276 pairs, some seconds in all; beyond, the time grows with the maps, not with their pairs.
  constexpr std::size_t kAllPairs = 24, kMostAlike = 8;
  if (maps_.size() <= kAllPairs) {
    for (auto a = maps_.begin(); a != maps_.end(); ++a)
      for (auto b = std::next(a); b != maps_.end(); ++b) pairs.emplace_back(a->first, b->first);
    return pairs;
  }
  using Word = std::array<int, 4>;
  const auto word_of = [](const MapSummary::Look& look) {
    constexpr int kWalls = 8;  // of a step: two metres of wall, by which views of one place differ
    Word word{};
    for (std::size_t ring = 0; ring < look.walls.size(); ++ring)
      word[ring * word.size() / look.walls.size()] += look.walls[ring];
    for (int& part : word) part /= kWalls;
    return word;
  };
  // Routes lie in one frame: what they share a square of five metres with are candidates.
  std::map<Word, std::vector<std::size_t>> seen_by;
  std::vector<const RobotId*> names;
  std::vector<std::set<Word>> words;
  for (const auto& [robot, entry] : maps_) {
    std::set<Word> own;
    const MapSummary& summary = entry.summary;
    if (summary.is_in_team_frame) {
      constexpr std::int32_t kSide = 20;  // cells; larger squares make more candidates, smaller ones more words
      for (std::int32_t row = 0; row < summary.rows; row += kSide / 2)
        for (std::int32_t column = 0; column < summary.columns; column += kSide / 2)
          if (summary.at(summary.left + column, summary.bottom + row) != Cell::unknown)
            own.insert({-1, -1, (summary.left + column) / kSide, (summary.bottom + row) / kSide});
    } else {
      for (const MapSummary::Look& look : summary.looks) own.insert(word_of(look));
    }
    for (const Word& word : own) seen_by[word].push_back(names.size());
    names.push_back(&robot);
    words.push_back(std::move(own));
  }
  std::set<std::pair<std::size_t, std::size_t>> chosen;
  for (std::size_t a = 0; a < names.size(); ++a) {
    std::map<std::size_t, double> votes;
    for (const Word& word : words[a]) {
      const auto& others = seen_by.at(word);
      constexpr std::size_t kCommon = 64;  // a word of so many is no evidence, but is asked of those beside
      const std::size_t at =
          static_cast<std::size_t>(std::lower_bound(others.begin(), others.end(), a) - others.begin());
      const std::size_t first = at > kCommon / 2 ? at - kCommon / 2 : 0,
                        last = std::min(others.size(), first + kCommon);
      for (std::size_t i = first; i < last; ++i)
        if (others[i] != a) votes[others[i]] += 1.0 / static_cast<double>(others.size());
    }
    std::vector<std::pair<double, std::size_t>> ranked;
    for (const auto& [b, vote] : votes) ranked.emplace_back(-vote, b);
    std::sort(ranked.begin(), ranked.end());
    for (std::size_t i = 0; i < std::min(kMostAlike, ranked.size()); ++i)
      chosen.emplace(std::min(a, ranked[i].second), std::max(a, ranked[i].second));
  }
  for (const auto& [a, b] : chosen) pairs.emplace_back(*names[a], *names[b]);
  return pairs;
}

std::vector<OverlapEstimator::Overlap> OverlapEstimator::overlaps() {
  std::map<std::pair<RobotId, RobotId>, double> degrees;
  std::vector<Overlap> shared;
  for (const auto& pair : candidates()) {
    const Entry &a = maps_.at(pair.first), &b = maps_.at(pair.second);
    const auto known = degrees_.find(pair);
    double degree = 0.0;
    if (known != degrees_.end() && !a.is_stale && !b.is_stale) {
      degree = known->second;
    } else if (const auto found = estimate_overlap(a.summary, b.summary)) {
      degree = found->degree;
    }
    degrees.emplace(pair, degree);
    if (degree > 0.0) shared.push_back({pair.first, pair.second, degree});
  }
  degrees_ = std::move(degrees);
  for (auto& [robot, entry] : maps_)
    if (entry.is_stale) {
      entry.is_stale = false;
      entry.compared = entry.summary;
    }
  return shared;
}

}  // namespace mapweave::scheduling
