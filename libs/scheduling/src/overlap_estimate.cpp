#include "summary_cells.h"

#include <mapweave/scheduling/overlap_estimate.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>
#include <map>
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

// How b may lie, by two viewpoints that look alike.
struct Guess {
  int score = 0;
  Pose2 a_from_b;
  std::size_t look = 0;          // of b, by its number
  std::vector<CellPoint> walls;  // of b, that stand around it
  bool is_inverted = false;      // found with a's walls on b: `look` and `walls` are a's
};

constexpr double kAround_m = 9.0;  // of a viewpoint: what stands there is compared; farther out, maps bend

std::vector<CellPoint> walls_around(const std::vector<CellPoint>& all, double x, double y) {
  std::vector<CellPoint> walls;
  for (const CellPoint& wall : all)
    if (std::hypot(wall.x - x, wall.y - y) < kAround_m) walls.push_back(wall);
  return walls;
}

// Spread evenly.
std::vector<CellPoint> some_of(const std::vector<CellPoint>& walls) {
  constexpr std::size_t kSome = 40;  // walls that stand for all while headings and shifts are tried: bounds the time
  std::vector<CellPoint> some;
  for (std::size_t i = 0; i < std::min(kSome, walls.size()); ++i)
    some.push_back(walls[i * walls.size() / std::min(kSome, walls.size())]);
  return some;
}

// What follows from viewpoints that look alike.
std::vector<Guess> guesses_of(const MapSummary& a, const MapSummary& b) {
  // Larger values find more pairs, and take longer in proportion (DECISIONS.md, 134).
  constexpr std::size_t kAlike = 5, kTried = 128;
  using Pair = std::tuple<int, std::size_t, std::size_t>;  // distance, looks
  std::vector<Pair> pairs;
  // Each viewpoint chooses those most like it: else a few that look like many take all places.
  for (std::size_t j = 0; j < b.looks.size(); ++j) {
    std::vector<Pair> of_look;
    for (std::size_t i = 0; i < a.looks.size(); ++i) of_look.emplace_back(distance(a.looks[i], b.looks[j]), i, j);
    std::sort(of_look.begin(), of_look.end());
    of_look.resize(std::min(of_look.size(), kAlike));
    pairs.insert(pairs.end(), of_look.begin(), of_look.end());
  }
  std::sort(pairs.begin(), pairs.end());
  if (pairs.size() > kTried) pairs.resize(kTried);
  const std::vector<CellPoint> all = walls_of(b);
  std::vector<std::vector<CellPoint>> around;
  for (const MapSummary::Look& look : b.looks) around.push_back(walls_around(all, 0.01 * look.x_cm, 0.01 * look.y_cm));
  std::vector<Guess> guesses;
  constexpr int kHeadings = 60;      // 6 degrees apart: refine() begins with half of that
  constexpr double kShift_m = 0.75;  // a ring: viewpoints that look alike lie about so near to each other
  for (const auto& [unlikeness, i, j] : pairs) {
    const MapSummary::Look &to = a.looks[i], &from = b.looks[j];
    const std::vector<CellPoint> some = some_of(around[j]);
    Guess best{0, {}, j, around[j], false};
    for (int heading = 0; heading < kHeadings; ++heading) {
      const double phi = wrap_angle(2.0 * M_PI * heading / kHeadings), c = std::cos(phi), s = std::sin(phi);
      const double x = 0.01 * (to.x_cm - c * from.x_cm + s * from.y_cm),
                   y = 0.01 * (to.y_cm - s * from.x_cm - c * from.y_cm);
      for (int shift = 0; shift < 9; ++shift) {
        const Pose2 pose{x + (shift % 3 - 1) * kShift_m, y + (shift / 3 - 1) * kShift_m, phi};
        if (const int score = agreement(a, some, pose).score(); score > best.score) {
          best.score = score;
          best.a_from_b = pose;
        }
      }
    }
    if (best.score > 0) guesses.push_back(std::move(best));
  }
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
          guess.score = score;
          guess.a_from_b = pose;
          is_better = true;
        }
      }
    }
}

bool contradicts(const Agreement& agreement, double at_most) {
  return agreement.contradictions > at_most * std::max(1, agreement.known);
}

// Whether what stands around a viewpoint of one map stands in the other one, too.
bool is_likely(const Agreement& found, std::size_t walls, bool are_small) {
  // Twelve cells that coincide, or three metres, make 24; up to twice as many lie beside.
  constexpr int kLeastWalls = 48, kLeastWallsOfSmall = 24, kFullOfSmall = 150;
  // Of walls that fall on what is known. Before loops are closed, maps drift: more is forgiven where much coincides.
  constexpr double kContradicting = 0.05, kContradictingOfSmall = 0.08, kContradictingWhereFull = 0.2;
  constexpr double kKnown = 0.6;  // of the walls, where the other map has been. Small maps share less
  if (are_small)
    return found.walls >= kLeastWallsOfSmall &&
           !contradicts(found, found.walls >= kFullOfSmall ? kContradictingWhereFull : kContradictingOfSmall);
  return found.walls >= kLeastWalls && !contradicts(found, kContradicting) &&
         found.known > kKnown * static_cast<double>(walls);
}

Pose2 place_of(const MapSummary::Look& look) { return {0.01 * look.x_cm, 0.01 * look.y_cm, 0.0}; }

std::vector<Guess> likely_guesses(const MapSummary& a, const MapSummary& b) {
  constexpr std::size_t kFew = 8;  // viewpoints of a small map: one of them sees most of it
  const bool are_small = a.looks.size() <= kFew && b.looks.size() <= kFew;
  // Of a's walls there, on b: places that are only alike contradict in one direction or the other. Small maps drift.
  constexpr double kContradictingBack = 0.08, kContradictingBackOfSmall = 0.15;
  const std::vector<CellPoint> all = walls_of(a);
  std::vector<Guess> likely;
  for (Guess& guess : guesses_of(a, b)) {
    refine(a, guess.walls, guess);
    const Agreement found = agreement(a, guess.walls, guess.a_from_b);
    if (!is_likely(found, guess.walls.size(), are_small)) continue;
    const Pose2 there = compose(guess.a_from_b, place_of(b.looks[guess.look]));
    const Agreement back = agreement(b, walls_around(all, there.x, there.y), inverse(guess.a_from_b));
    if (contradicts(back, are_small ? kContradictingBackOfSmall : kContradictingBack)) continue;
    likely.push_back(std::move(guess));
  }
  return likely;
}

// With each map's walls on the other: the answer is the same whichever comes first.
std::vector<Guess> likely_guesses_of_both(const MapSummary& a, const MapSummary& b) {
  std::vector<Guess> guesses = likely_guesses(a, b);
  for (Guess& guess : likely_guesses(b, a)) {
    guess.a_from_b = inverse(guess.a_from_b);
    guess.is_inverted = true;
    guesses.push_back(std::move(guess));
  }
  return guesses;
}

// Of all guesses that say about the same, each viewpoint once.
int score_of_all(const Guess& guess, const std::vector<Guess>& guesses, const MapSummary& a, const MapSummary& b) {
  constexpr double kSame_m = 0.8, kBend_per_m = 0.05, kSame_rad = 0.12;  // maps bend
  const auto place_in_b = [&](const Guess& of) {
    return of.is_inverted ? compose(inverse(of.a_from_b), place_of(a.looks[of.look])) : place_of(b.looks[of.look]);
  };
  const Pose2 own = place_in_b(guess);
  std::map<std::pair<bool, std::size_t>, int> scores;
  for (const Guess& other : guesses) {
    const Pose2 there = place_in_b(other);
    const Pose2 apart = between(compose(guess.a_from_b, there), compose(other.a_from_b, there));
    const double far_m = std::hypot(there.x - own.x, there.y - own.y);
    int& score = scores[{other.is_inverted, other.look}];
    if (std::hypot(apart.x, apart.y) < kSame_m + kBend_per_m * far_m && std::abs(apart.phi) < kSame_rad)
      score = std::max(score, other.score);
  }
  int sum = 0;
  for (const auto& [look, score] : scores) sum += score;
  return sum;
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
  const Guess* best = nullptr;
  std::pair<int, int> most;  // of all that say the same, then its own
  const std::vector<Guess> guesses = likely_guesses_of_both(a, b);
  for (const Guess& guess : guesses)
    if (const std::pair score(score_of_all(guess, guesses, a, b), guess.score); score > most) {
      most = score;
      best = &guess;
    }
  if (best == nullptr) return std::nullopt;
  return EstimatedOverlap{best->a_from_b, overlap_degree(a, b, best->a_from_b)};
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
