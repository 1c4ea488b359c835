// Aligns pairs of map_server grids. Each line of the standard input names two YAML files and whether the second is flipped ("A.yaml B.yaml
// 0"); each line of the output is what came of it, as JSON.

#include <mapweave/core/error.h>
#include <mapweave/exporters/map_server.h>
#include <mapweave/fusion/grid_pair.h>

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <iostream>
#include <map>

namespace {

using namespace mapweave;

OccupancyGrid flipped(OccupancyGrid grid) {
  for (int row = 0; row < grid.rows / 2; ++row)
    std::swap_ranges(grid.log_odds.begin() + static_cast<std::ptrdiff_t>(row) * grid.columns,
                     grid.log_odds.begin() + static_cast<std::ptrdiff_t>(row + 1) * grid.columns,
                     grid.log_odds.begin() + static_cast<std::ptrdiff_t>(grid.rows - 1 - row) * grid.columns);
  return grid;
}

void print(const char* name, const std::vector<fusion::GridVerification>& all) {
  std::printf(", \"%s\": [", name);
  for (std::size_t i = 0; i < all.size(); ++i) {
    const auto& one = all[i];
    std::printf(
        "%s{\"pose\": [%.4f, %.4f, %.6f], \"scale\": %.5f, \"fit\": [%.1f, %.1f], \"conflict\": [%.1f, %.1f], \"support\": %.2f, "
        "\"overlap\": %.3f, \"bend\": %.1f, \"contradiction\": [%.1f, %.1f]}",
        i == 0 ? "" : ", ", one.a_from_b.pose.x, one.a_from_b.pose.y, one.a_from_b.pose.phi, one.a_from_b.scale, one.fit_m[0], one.fit_m[1],
        one.conflict_m[0], one.conflict_m[1], one.support_m, one.overlap, one.bend_chi2, one.contradiction_m[0], one.contradiction_m[1]);
  }
  std::printf("]");
}

}  // namespace

int main() {
  std::map<std::pair<std::string, bool>, std::shared_ptr<const fusion::PreparedGrid>> prepared;
  const auto get = [&](const std::string& path, bool flip) {
    auto& grid = prepared[{path, flip}];
    if (!grid) {
      const OccupancyGrid read = exporters::read_map_server(path);
      grid = fusion::prepare_grid(flip ? flipped(read) : read);
    }
    return grid;
  };
  try {
    std::string a, b;
    bool flip = false;
    while (std::cin >> a >> b >> flip) {
      const auto grid_a = get(a, false), grid_b = get(b, flip);
      const std::clock_t start = std::clock();
      const auto result = fusion::align_grids(*grid_a, *grid_b);
      const double seconds = static_cast<double>(std::clock() - start) / CLOCKS_PER_SEC;
      const Pose2 rigid = result.alignment ? planar(result.alignment->a_from_b.pose) : Pose2{};
      std::printf(
          "{\"a\": \"%s\", \"b\": \"%s\", \"flipped\": %s, \"joined\": %s, \"probability\": %.5f, \"reason\": \"%s\", \"note\": \"%s\", "
          "\"rigid\": [%.4f, %.4f, %.6f], \"rival\": %.4f, \"conflict\": %.4f, \"ties\": %zu, \"seconds\": %.2f, \"wall\": %.1f",
          a.c_str(), b.c_str(), flip ? "true" : "false", result.reason == Reason::none ? "true" : "false", result.probability,
          std::string(to_text(result.reason)).c_str(), result.note.c_str(), rigid.x, rigid.y, rigid.phi, result.evidence.second_best_ratio,
          result.evidence.conflict, result.ties.size(), seconds, result.wall_m);
      print("hypotheses", result.hypotheses);
      print("images", result.images);
      std::printf("}\n");
      std::fflush(stdout);
    }
  } catch (const Error& error) {
    return std::fprintf(stderr, "%s\n", error.what()), 3;
  }
  return 0;
}
