// The essential graph of a map after a loop: pose_graph_benchmark [KEYFRAMES]; by default as many as CVS's table II
// asks for. Paths of a drifting robot through a hall, in rounds, each keyframe constrained to the four before it and to
// the one a round ago.
#include <mapweave/graph/spatial_graph.h>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <random>

using namespace mapweave;

int main(int argc, char** argv) {
  const int keyframes = argc > 1 ? std::atoi(argv[1]) : 1000;
  constexpr int kRounds = 5;
  constexpr double kRadius_m = 15.0;
  std::mt19937_64 random(1);
  std::normal_distribution<double> normal;
  const auto motion = [&](double metres, double radians) {
    const Eigen::Vector3d turn = radians * Eigen::Vector3d(normal(random), normal(random), normal(random));
    return Pose3{metres * Eigen::Vector3d(normal(random), normal(random), normal(random)),
                 Eigen::Quaterniond(Eigen::AngleAxisd(turn.norm(), turn.normalized()))};
  };
  std::vector<Pose3> truth, initial;
  std::vector<graph::SpatialEdge> edges;
  const auto constraint = [&](int from, int to, double metres, double radians) {
    graph::SpatialEdge edge;
    edge.from = static_cast<std::uint32_t>(from);
    edge.to = static_cast<std::uint32_t>(to);
    edge.from_from_to = compose(between(truth[static_cast<std::size_t>(from)], truth[static_cast<std::size_t>(to)]),
                                motion(metres, radians));
    edge.information.topLeftCorner<3, 3>() *= 1.0 / (metres * metres);
    edge.information.bottomRightCorner<3, 3>() *= 1.0 / (radians * radians);
    edges.push_back(edge);
  };
  for (int i = 0; i < keyframes; ++i) {
    const double angle = 2.0 * M_PI * kRounds * i / keyframes;
    truth.push_back({{kRadius_m * std::cos(angle), kRadius_m * std::sin(angle), 0.2 * std::sin(3.0 * angle)},
                     Eigen::Quaterniond(Eigen::AngleAxisd(angle, Eigen::Vector3d::UnitZ()))});
    for (int before = std::max(0, i - 4); before < i; ++before) constraint(before, i, 0.01, 0.003);
    initial.push_back(i == 0 ? truth.back() : compose(initial.back(), edges.back().from_from_to));
    if (i >= keyframes / kRounds) constraint(i - keyframes / kRounds, i, 0.02, 0.01);
  }
  const auto error_m = [&](const std::vector<Pose3>& poses) {
    double sum = 0.0;
    for (std::size_t i = 0; i < truth.size(); ++i) sum += (poses[i].t - truth[i].t).squaredNorm();
    return std::sqrt(sum / static_cast<double>(truth.size()));
  };
  const std::clock_t begin = std::clock();
  const graph::SpatialSolution solved = graph::solve(initial, edges);
  const double seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  std::printf("%d keyframes, %zu edges: %.3f s of processor time, %d iterations, error %.3f -> %.4f m\n", keyframes,
              edges.size(), seconds, solved.iterations, error_m(initial), error_m(solved.poses));
}
