#include <mapweave/core/error.h>
#include <mapweave/matching/branch_and_bound.h>

#include <algorithm>
#include <numeric>
#include <queue>
#include <tuple>

namespace mapweave::matching {
namespace {

constexpr double kStep = SubmapModel::kSearchResolution;
constexpr int kTopLevel = 4;  // coarser blocks hold a wall nearly always: they bound nothing

struct Candidate {
  int turn, x, y, level;  // shifts [x, x + 2^level) in cells, likewise y
  std::uint32_t bound;    // sum of likelihoods no shift of these exceeds
};

// Best first; ties by place, so the order is always the same.
struct Later {
  bool operator()(const Candidate& a, const Candidate& b) const {
    return std::tie(a.bound, b.level, b.turn, b.y, b.x) < std::tie(b.bound, a.level, a.turn, a.y, a.x);
  }
};

inline int shifted(int v, int level) { return v >> level; }  // floor division, also of negative numbers

}  // namespace

std::vector<Peak> search_peaks(const SubmapModel& a, const SubmapModel& b, const WideWindow& window, const SearchOptions& options) {
  std::vector<Peak> peaks;
  const auto& points = b.query();
  if (a.walls().empty() || points.empty()) return peaks;
  // Turns are about the middle of b's walls, so that a turn moves the far points least.
  const Point2f centre = b.centre();
  double arm = 0.0;
  for (const auto& p : points) arm += std::hypot(p.x - centre.x, p.y - centre.y) / static_cast<double>(points.size());
  arm = std::max(2.0, arm);
  const double yaw_step = std::clamp(2.0 * kStep / arm, 0.01, 0.05);
  const bool around = window.yaw_rad >= M_PI - 1e-9;
  const int turns = around ? static_cast<int>(std::ceil(M_PI / yaw_step)) : static_cast<int>(std::ceil(window.yaw_rad / yaw_step));
  const int first_turn = around ? -turns + 1 : -turns;
  const double turn_size = around ? M_PI / turns : yaw_step;
  const int radius = std::max(1, static_cast<int>(std::ceil(window.radius_m / kStep)));
  int top = 0;
  while (top < kTopLevel && (2 << top) <= radius) ++top;

  const Pose2 middle = window.a_from_b;
  const double middle_x = middle.x + std::cos(middle.phi) * centre.x - std::sin(middle.phi) * centre.y;
  const double middle_y = middle.y + std::sin(middle.phi) * centre.x + std::cos(middle.phi) * centre.y;
  const auto turned = [&](int turn) { return middle.phi + turn * turn_size; };
  std::size_t stride = points.size() / 2 + 1;
  while (std::gcd(stride, points.size()) != 1) ++stride;
  // Cells of b's points at shift zero, per turn.
  std::vector<std::vector<std::pair<int, int>>> cells(static_cast<std::size_t>(turns - first_turn + 1));
  for (int turn = first_turn; turn <= turns; ++turn) {
    const double c = std::cos(turned(turn)), s = std::sin(turned(turn));
    auto& out = cells[static_cast<std::size_t>(turn - first_turn)];
    out.reserve(points.size());
    // In an order that jumps about, so that the first few stand for all.
    for (std::size_t k = 0; k < points.size(); ++k) {
      const auto& p = points[k * stride % points.size()];
      const double dx = p.x - centre.x, dy = p.y - centre.y;
      out.emplace_back(cell_of(middle_x + c * dx - s * dy, 1.0 / kStep), cell_of(middle_y + s * dx + c * dy, 1.0 / kStep));
    }
  }
  const auto full = static_cast<double>(255 * points.size());
  auto threshold = static_cast<std::uint32_t>(options.min_score * full);
  // Zero as soon as what is left cannot reach the threshold.
  const auto bound_of = [&](int turn, int x, int y, int level) {
    const auto& raster = a.pyramid()[static_cast<std::size_t>(level)];
    const auto& here = cells[static_cast<std::size_t>(turn - first_turn)];
    std::uint32_t sum = 0, possible = static_cast<std::uint32_t>(255 * here.size());
    for (std::size_t k = 0; k < here.size();) {
      const std::size_t end = std::min(k + 16, here.size());
      possible -= static_cast<std::uint32_t>(255 * (end - k));
      for (; k < end; ++k) sum += raster.get(shifted(here[k].first + x, level), shifted(here[k].second + y, level));
      if (sum + possible < threshold) return std::uint32_t{0};
    }
    return sum;
  };
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
  for (int turn = first_turn; turn <= turns; ++turn)
    for (int y = -radius; y <= radius; y += 1 << top)
      for (int x = -radius; x <= radius; x += 1 << top) {
        const auto bound = bound_of(turn, x, y, top);
        if (bound >= threshold) open.push({turn, x, y, top, bound});
      }
  std::size_t looked = 0;
  while (!open.empty() && peaks.size() < options.most_peaks && looked < options.budget) {
    const Candidate candidate = open.top();
    open.pop();
    if (candidate.bound < threshold) break;
    // Best first: what an earlier peak covers can only be worse than it.
    const double reach = 0.5 * kStep * ((1 << candidate.level) - 1);
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
      if (peaks.size() == 1) threshold = std::max(threshold, static_cast<std::uint32_t>(options.rival_ratio * candidate.bound));
      continue;
    }
    const int level = candidate.level - 1;
    for (int j = 0; j < 2; ++j)
      for (int i = 0; i < 2; ++i) {
        const int nx = candidate.x + (i << level), ny = candidate.y + (j << level);
        if (nx > radius || ny > radius) continue;
        const auto bound = bound_of(candidate.turn, nx, ny, level);
        ++looked;
        if (bound >= threshold) open.push({candidate.turn, nx, ny, level, bound});
      }
  }
  return peaks;
}

}  // namespace mapweave::matching
