#include <mapweave/core/error.h>
#include <mapweave/core/processor_clones.h>
#include <mapweave/matching/branch_and_bound.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <numeric>
#include <optional>
#include <queue>
#include <tuple>

namespace mapweave::matching {
namespace {

constexpr double kStep = SubmapModel::kSearchResolution;
constexpr int kTopLevel = SubmapModel::kLevels - 1;

int size_of(int level) { return 1 << (2 * level); }

struct Candidate {
  int turn, x, y, level;  // shifts [x, x + 4^level) in cells, likewise y; x and y are multiples of 4^level
  std::uint32_t bound;    // sum of likelihoods no shift of these exceeds
};

// Best first; ties by place, so the order is always the same.
struct Later {
  bool operator()(const Candidate& a, const Candidate& b) const {
    return std::tie(a.bound, b.level, b.turn, b.y, b.x) < std::tie(b.bound, a.level, a.turn, a.y, a.x);
  }
};

// A level of a's pyramid with so much nothing around it that every shift of every point lies in it. Four cells above
// each other stand together, so that 4 x 4 of them are 16 bytes in a row.
class Padded {
 public:
  // `reach`: cells of the level, from its cell (middle_x, middle_y), that are asked for.
  Padded(const SparseRaster<std::uint8_t>& level, int middle_x, int middle_y, int reach)
      : x0_(middle_x - reach),
        y0_(middle_y - reach),
        width_(2 * reach + 1),
        cells_(static_cast<std::size_t>(width_) * width_) {
    level.for_each_run([&](int x, int y, const std::uint8_t* cells, int count) {
      if (y < y0_ || y - 3 >= y0_ + width_) return;
      const int last = std::min(count, x0_ + width_ - x);
      for (int k = std::max(0, x0_ - x); k < last; ++k) {
        if (cells[k] == 0) continue;
        for (int j = std::max(0, y - y0_ - width_ + 1); j < 4 && y - j >= y0_; ++j)
          cells_[static_cast<std::size_t>(offset(x + k, y - j) - offset(x0_, y0_))][static_cast<std::size_t>(j)] =
              cells[k];
      }
    });
  }
  using Column = std::array<std::uint8_t, 4>;
  int offset(int x, int y) const { return y * width_ + x; }
  const Column* at(int x, int y) const { return cells_.data() + (offset(x, y) - offset(x0_, y0_)); }

 private:
  int x0_, y0_, width_;
  std::vector<Column> cells_;
};

using Sums = std::array<std::uint16_t, 16>;  // of 4 x 4 cells, column by column
constexpr std::size_t kMostPoints = 257;     // of which the likelihoods' sum fits

typedef std::uint8_t Bytes16 __attribute__((vector_size(16)));
typedef std::uint16_t Shorts16 __attribute__((vector_size(32)));

// For 4 x 4 shifts at once: sums of the likelihoods under the points. False as soon as none of them can reach the
// threshold.
MAPWEAVE_WIDE_CLONES bool sum_up(const Padded::Column* corner, const std::int32_t* offsets, std::size_t count,
                                 std::uint32_t threshold, Sums& sums) {
  Shorts16 all{};
  for (std::size_t k = 0; k < count;) {
    for (const std::size_t end = std::min(k + 20, count); k < end; ++k) {
      Bytes16 cells;
      std::memcpy(&cells, corner + offsets[k], sizeof cells);
      all += __builtin_convertvector(cells, Shorts16);
    }
    std::uint16_t largest = 0;
    for (int i = 0; i < 16; ++i) largest = std::max(largest, static_cast<std::uint16_t>(all[i]));
    if (largest + 255 * (count - k) < threshold) return false;
  }
  std::memcpy(sums.data(), &all, sizeof all);
  return true;
}

// The turns of a window: first ... last steps of `step_rad` from its middle.
struct Turns {
  int first, last;
  double step_rad;
};

// So small that the far points of b move by less than two cells.
Turns turns_of(const SubmapModel& b, double yaw_rad) {
  const auto& points = b.query();
  const Point2f centre = b.centre();
  double arm = 0.0;
  for (const auto& p : points) arm += std::hypot(p.x - centre.x, p.y - centre.y) / static_cast<double>(points.size());
  arm = std::max(2.0, arm);
  const double step_rad = std::clamp(2.0 * kStep / arm, 0.01, 0.05);
  if (yaw_rad >= M_PI - 1e-9) {
    const int turns = static_cast<int>(std::ceil(M_PI / step_rad));
    return {-turns + 1, turns, M_PI / turns};
  }
  const int turns = static_cast<int>(std::ceil(yaw_rad / step_rad));
  return {-turns, turns, step_rad};
}

double farthest_from(const Point2f& centre, const std::vector<Point2f>& points) {
  double farthest = 0.0;
  for (const auto& p : points)
    farthest = std::max(farthest, std::hypot(static_cast<double>(p.x) - centre.x, static_cast<double>(p.y) - centre.y));
  return farthest;
}

// Turns are about the middle of b's walls, so that a turn moves the far points least. Shifts begin at multiples of
// their block's size, so that a point's cell at any shift is that at shift zero, shifted by whole cells of the level.
class PeakSearch {
 public:
  // All outlive it.
  PeakSearch(const SubmapModel& a, const SubmapModel& b, const WideWindow& window, const SearchOptions& options)
      : a_(a),
        points_(b.query()),
        options_(options),
        centre_(b.centre()),
        middle_(window.a_from_b),
        turns_(turns_of(b, window.yaw_rad)),
        radius_(std::max(1, static_cast<int>(std::ceil(window.radius_m / kStep)))),
        offsets_(static_cast<std::size_t>(turns_.last - turns_.first + 1)),
        threshold_(static_cast<std::uint32_t>(options.min_score * static_cast<double>(255 * points_.size()))) {
    while (top_ < kTopLevel && size_of(top_ + 1) <= radius_) ++top_;
    std::tie(middle_x_, middle_y_) = centre_of(middle_);
    middle_cell_x_ = cell_of(middle_x_, 1.0 / kStep);
    middle_cell_y_ = cell_of(middle_y_, 1.0 / kStep);
    const double farthest = farthest_from(centre_, points_);
    extent_ = radius_ + size_of(top_ + 1) + static_cast<int>(std::ceil(farthest / kStep)) + 2;
    stride_ = points_.size() / 2 + 1;
    while (std::gcd(stride_, points_.size()) != 1) ++stride_;
  }

  std::vector<Peak> run() {
    open_window();
    looked_ = 0;
    std::vector<Peak> peaks;
    const auto full = static_cast<double>(255 * points_.size());
    while (!open_.empty() && peaks.size() < options_.most_peaks && looked_ < options_.budget) {
      const Candidate candidate = open_.top();
      open_.pop();
      if (candidate.bound < threshold_) break;
      if (is_covered(candidate, peaks)) continue;
      if (candidate.level > 0) {
        open_blocks(candidate.turn, candidate.x, candidate.y, candidate.level - 1);
        continue;
      }
      peaks.push_back({pose_of(candidate), candidate.bound / full});
      if (peaks.size() == 1)
        threshold_ = std::max(threshold_, static_cast<std::uint32_t>(options_.rival_ratio * candidate.bound));
    }
    return peaks;
  }

 private:
  double turned(int turn) const { return middle_.phi + turn * turns_.step_rad; }

  Pose2 pose_of(const Candidate& candidate) const {
    const double phi = turned(candidate.turn), c = std::cos(phi), s = std::sin(phi);
    return {middle_x_ + candidate.x * kStep - (c * centre_.x - s * centre_.y),
            middle_y_ + candidate.y * kStep - (s * centre_.x + c * centre_.y), wrap_angle(phi)};
  }

  // Where b's centre lies under a pose: what distances between peaks are measured at.
  std::pair<double, double> centre_of(const Pose2& pose) const {
    return {pose.x + std::cos(pose.phi) * centre_.x - std::sin(pose.phi) * centre_.y,
            pose.y + std::sin(pose.phi) * centre_.x + std::cos(pose.phi) * centre_.y};
  }

  const Padded& level_of(int level) {
    auto& padded = levels_[static_cast<std::size_t>(level)];
    if (!padded)
      padded.emplace(a_.pyramid()[static_cast<std::size_t>(level)], middle_cell_x_ >> (2 * level),
                     middle_cell_y_ >> (2 * level), (extent_ >> (2 * level)) + 5);
    return *padded;
  }

  // Where b's points lie in a level at shift zero.
  const std::vector<std::int32_t>& offsets_of(int turn, int level) {
    auto& known = offsets_[static_cast<std::size_t>(turn - turns_.first)][static_cast<std::size_t>(level)];
    if (!known.empty()) return known;
    const Padded& padded = level_of(level);
    const double c = std::cos(turned(turn)), s = std::sin(turned(turn));
    known.reserve(points_.size());
    // In an order that jumps about, so that the first few stand for all.
    for (std::size_t k = 0; k < points_.size(); ++k) {
      const auto& p = points_[k * stride_ % points_.size()];
      const double dx = p.x - centre_.x, dy = p.y - centre_.y;
      known.push_back(padded.offset(cell_of(middle_x_ + c * dx - s * dy, 1.0 / kStep) >> (2 * level),
                                    cell_of(middle_y_ + s * dx + c * dy, 1.0 / kStep) >> (2 * level)) -
                      padded.offset(middle_cell_x_ >> (2 * level), middle_cell_y_ >> (2 * level)));
    }
    return known;
  }

  // The whole window, in the largest blocks.
  void open_window() {
    const int size = size_of(top_), first = -((radius_ + size - 1) / size) * size;
    for (int turn = turns_.first; turn <= turns_.last; ++turn)
      for (int y = first; y <= radius_; y += size_of(top_ + 1))
        for (int x = first; x <= radius_; x += size_of(top_ + 1)) open_blocks(turn, x, y, top_);
  }

  // The 4 x 4 blocks from (x, y) on.
  void open_blocks(int turn, int x, int y, int level) {
    const Padded& padded = level_of(level);
    const int size = size_of(level);
    Sums sums;
    looked_ += sums.size();
    const auto& places = offsets_of(turn, level);
    if (!sum_up(padded.at((middle_cell_x_ + x) >> (2 * level), (middle_cell_y_ + y) >> (2 * level)), places.data(),
                places.size(), threshold_, sums))
      return;
    for (int k = 0; k < 16; ++k) {
      const int nx = x + (k / 4) * size, ny = y + (k % 4) * size;
      const std::uint32_t bound = sums[static_cast<std::size_t>(k)];
      if (bound < threshold_ || nx > radius_ || ny > radius_ || nx + size <= -radius_ || ny + size <= -radius_)
        continue;
      open_.push({turn, nx, ny, level, bound});
    }
  }

  // Best first: what an earlier peak covers can only be worse than it.
  bool is_covered(const Candidate& candidate, const std::vector<Peak>& peaks) const {
    const double reach = 0.5 * kStep * (size_of(candidate.level) - 1);
    const double x = middle_x_ + candidate.x * kStep + reach, y = middle_y_ + candidate.y * kStep + reach;
    return std::any_of(peaks.begin(), peaks.end(), [&](const Peak& peak) {
      const auto [px, py] = centre_of(peak.a_from_b);
      return std::hypot(x - px, y - py) + 1.5 * reach < options_.peak_distance_m &&
             std::abs(wrap_angle(turned(candidate.turn) - peak.a_from_b.phi)) < options_.peak_yaw_rad;
    });
  }

  const SubmapModel& a_;
  const std::vector<Point2f>& points_;  // of b
  const SearchOptions& options_;
  Point2f centre_;  // of b's walls
  Pose2 middle_;    // of the window
  Turns turns_;
  int radius_, top_ = 0, extent_ = 0;       // cells; level; cells that any point may be asked for
  double middle_x_ = 0.0, middle_y_ = 0.0;  // where the middle puts the centre
  int middle_cell_x_ = 0, middle_cell_y_ = 0;
  std::size_t stride_ = 1;
  std::array<std::optional<Padded>, SubmapModel::kLevels> levels_;
  std::vector<std::array<std::vector<std::int32_t>, SubmapModel::kLevels>> offsets_;  // per turn
  std::uint32_t threshold_;
  std::priority_queue<Candidate, std::vector<Candidate>, Later> open_;
  std::size_t looked_ = 0;
};

}  // namespace

std::vector<Peak> search_peaks(const SubmapModel& a, const SubmapModel& b, const WideWindow& window,
                               const SearchOptions& options) {
  if (a.walls().empty() || b.query().empty()) return {};
  MAPWEAVE_EXPECT(b.query().size() <= kMostPoints, "sums of likelihoods fit");
  return PeakSearch(a, b, window, options).run();
}

}  // namespace mapweave::matching
