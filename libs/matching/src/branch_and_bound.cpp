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
  Padded(const Raster<std::uint8_t>& level, int middle_x, int middle_y, int reach)
      : x0_(middle_x - reach),
        y0_(middle_y - reach),
        width_(2 * reach + 1),
        cells_(static_cast<std::size_t>(width_) * width_) {
    const int first_x = std::max(x0_, level.first_x()),
              last_x = std::min(x0_ + width_, level.first_x() + level.width());
    const int first_y = std::max(y0_, level.first_y() - 3),
              last_y = std::min(y0_ + width_, level.first_y() + level.height());
    for (int y = first_y; y < last_y && first_x < last_x; ++y) {
      Column* to = &cells_[static_cast<std::size_t>(offset(first_x, y) - offset(x0_, y0_))];
      for (int j = 0; j < 4; ++j) {
        if (y + j < level.first_y() || y + j >= level.first_y() + level.height()) continue;
        const std::uint8_t* from = level.row(first_x, y + j);
        for (int x = 0; x < last_x - first_x; ++x) to[x][static_cast<std::size_t>(j)] = from[x];
      }
    }
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

}  // namespace

std::vector<Peak> search_peaks(const SubmapModel& a, const SubmapModel& b, const WideWindow& window,
                               const SearchOptions& options) {
  std::vector<Peak> peaks;
  const auto& points = b.query();
  if (a.walls().empty() || points.empty()) return peaks;
  MAPWEAVE_EXPECT(points.size() <= kMostPoints, "sums of likelihoods fit");
  // Turns are about the middle of b's walls, so that a turn moves the far points least.
  const Point2f centre = b.centre();
  double arm = 0.0;
  for (const auto& p : points) arm += std::hypot(p.x - centre.x, p.y - centre.y) / static_cast<double>(points.size());
  arm = std::max(2.0, arm);
  const double yaw_step = std::clamp(2.0 * kStep / arm, 0.01, 0.05);
  const bool around = window.yaw_rad >= M_PI - 1e-9;
  const int turns =
      around ? static_cast<int>(std::ceil(M_PI / yaw_step)) : static_cast<int>(std::ceil(window.yaw_rad / yaw_step));
  const int first_turn = around ? -turns + 1 : -turns;
  const double turn_size = around ? M_PI / turns : yaw_step;
  const int radius = std::max(1, static_cast<int>(std::ceil(window.radius_m / kStep)));
  int top = 0;
  while (top < kTopLevel && size_of(top + 1) <= radius) ++top;

  const Pose2 middle = window.a_from_b;
  const double middle_x = middle.x + std::cos(middle.phi) * centre.x - std::sin(middle.phi) * centre.y;
  const double middle_y = middle.y + std::sin(middle.phi) * centre.x + std::cos(middle.phi) * centre.y;
  const auto turned = [&](int turn) { return middle.phi + turn * turn_size; };
  std::size_t stride = points.size() / 2 + 1;
  while (std::gcd(stride, points.size()) != 1) ++stride;
  // Shifts begin at multiples of their block's size, so that a point's cell at any shift is that at shift zero, shifted
  // by whole cells of the level.
  const int middle_cell_x = cell_of(middle_x, 1.0 / kStep), middle_cell_y = cell_of(middle_y, 1.0 / kStep);
  double farthest = 0.0;
  for (const auto& p : points)
    farthest = std::max(farthest, std::hypot(static_cast<double>(p.x) - centre.x, static_cast<double>(p.y) - centre.y));
  const int extent = radius + size_of(top + 1) + static_cast<int>(std::ceil(farthest / kStep)) + 2;
  std::array<std::optional<Padded>, SubmapModel::kLevels> levels;
  const auto level_of = [&](int level) -> const Padded& {
    auto& padded = levels[static_cast<std::size_t>(level)];
    if (!padded)
      padded.emplace(a.pyramid()[static_cast<std::size_t>(level)], middle_cell_x >> (2 * level),
                     middle_cell_y >> (2 * level), (extent >> (2 * level)) + 5);
    return *padded;
  };
  // Where b's points lie in a level at shift zero, per turn.
  std::vector<std::array<std::vector<std::int32_t>, SubmapModel::kLevels>> offsets(
      static_cast<std::size_t>(turns - first_turn + 1));
  const auto offsets_of = [&](int turn, int level) -> const std::vector<std::int32_t>& {
    auto& known = offsets[static_cast<std::size_t>(turn - first_turn)][static_cast<std::size_t>(level)];
    if (!known.empty()) return known;
    const Padded& padded = level_of(level);
    const double c = std::cos(turned(turn)), s = std::sin(turned(turn));
    known.reserve(points.size());
    // In an order that jumps about, so that the first few stand for all.
    for (std::size_t k = 0; k < points.size(); ++k) {
      const auto& p = points[k * stride % points.size()];
      const double dx = p.x - centre.x, dy = p.y - centre.y;
      known.push_back(padded.offset(cell_of(middle_x + c * dx - s * dy, 1.0 / kStep) >> (2 * level),
                                    cell_of(middle_y + s * dx + c * dy, 1.0 / kStep) >> (2 * level)) -
                      padded.offset(middle_cell_x >> (2 * level), middle_cell_y >> (2 * level)));
    }
    return known;
  };
  const auto full = static_cast<double>(255 * points.size());
  auto threshold = static_cast<std::uint32_t>(options.min_score * full);
  const auto pose_of = [&](const Candidate& candidate) {
    const double phi = turned(candidate.turn), c = std::cos(phi), s = std::sin(phi);
    return Pose2{middle_x + candidate.x * kStep - (c * centre.x - s * centre.y),
                 middle_y + candidate.y * kStep - (s * centre.x + c * centre.y), wrap_angle(phi)};
  };
  // Where b's centre lies under a pose: what distances between peaks are measured at.
  const auto centre_of = [&](const Pose2& pose) {
    return std::make_pair(pose.x + std::cos(pose.phi) * centre.x - std::sin(pose.phi) * centre.y,
                          pose.y + std::sin(pose.phi) * centre.x + std::cos(pose.phi) * centre.y);
  };

  std::priority_queue<Candidate, std::vector<Candidate>, Later> open;
  std::size_t looked = 0;
  // The 4 x 4 blocks from (x, y) on.
  const auto open_blocks = [&](int turn, int x, int y, int level) {
    const Padded& padded = level_of(level);
    const int size = size_of(level);
    Sums sums;
    looked += sums.size();
    const auto& places = offsets_of(turn, level);
    if (!sum_up(padded.at((middle_cell_x + x) >> (2 * level), (middle_cell_y + y) >> (2 * level)), places.data(),
                places.size(), threshold, sums))
      return;
    for (int k = 0; k < 16; ++k) {
      const int nx = x + (k / 4) * size, ny = y + (k % 4) * size;
      const std::uint32_t bound = sums[static_cast<std::size_t>(k)];
      if (bound < threshold || nx > radius || ny > radius || nx + size <= -radius || ny + size <= -radius) continue;
      open.push({turn, nx, ny, level, bound});
    }
  };
  const int first = -((radius + size_of(top) - 1) / size_of(top)) * size_of(top);
  for (int turn = first_turn; turn <= turns; ++turn)
    for (int y = first; y <= radius; y += size_of(top + 1))
      for (int x = first; x <= radius; x += size_of(top + 1)) open_blocks(turn, x, y, top);
  looked = 0;
  while (!open.empty() && peaks.size() < options.most_peaks && looked < options.budget) {
    const Candidate candidate = open.top();
    open.pop();
    if (candidate.bound < threshold) break;
    // Best first: what an earlier peak covers can only be worse than it.
    const double reach = 0.5 * kStep * (size_of(candidate.level) - 1);
    const double x = middle_x + candidate.x * kStep + reach, y = middle_y + candidate.y * kStep + reach;
    bool covered = false;
    for (const auto& peak : peaks) {
      const auto [px, py] = centre_of(peak.a_from_b);
      covered = covered || (std::hypot(x - px, y - py) + 1.5 * reach < options.peak_distance_m &&
                            std::abs(wrap_angle(turned(candidate.turn) - peak.a_from_b.phi)) < options.peak_yaw_rad);
    }
    if (covered) continue;
    if (candidate.level == 0) {
      peaks.push_back({pose_of(candidate), candidate.bound / full});
      if (peaks.size() == 1)
        threshold = std::max(threshold, static_cast<std::uint32_t>(options.rival_ratio * candidate.bound));
      continue;
    }
    open_blocks(candidate.turn, candidate.x, candidate.y, candidate.level - 1);
  }
  return peaks;
}

}  // namespace mapweave::matching
