#include "bent_grid.h"

#include <mapweave/graph/pose_graph.h>

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

namespace mapweave::fusion {
namespace {

using matching::PlanarSimilarity;
using matching::WallPoint;

constexpr std::size_t kMostSamples = 8000;  // faces: bounds time
constexpr int kMostTiles = 32;              // across
constexpr double kLeastCosine = 0.6;        // between faces of one wall, where grids are bent
// From how wrong a proposal may be to how far grids bend.
constexpr double kRefineRadii_m[] = {1.5, 1.0, 0.7, 0.5};
constexpr int kRefineRounds = 3;                             // per radius
constexpr std::size_t kFewest = 20;                          // faces that a refinement needs
constexpr double kScalePrior = 0.08;                         // pulls the scale back, in square metres per face
constexpr int kBendRounds = 10;                              // in which the reach shrinks from first to last
constexpr double kFirstRadius_m = 1.5, kLastRadius_m = 0.5;  // as kRefineRadii_m
// Of a face from the one it is matched to: cells, and what bends within a tile.
constexpr double kFaceSigma_m = 0.15;
constexpr double kFaceWeight = 0.12;  // neighbouring faces of one wall err together

WallPoint turned(const WallPoint& face, double c, double s, double x, double y) {
  return {static_cast<float>(x), static_cast<float>(y), static_cast<float>(c * face.normal_x - s * face.normal_y),
          static_cast<float>(s * face.normal_x + c * face.normal_y)};
}

WallPoint placed(const PlanarSimilarity& a_from_b, const WallPoint& face) {
  const auto p = transformed(a_from_b, {face.x, face.y});
  return turned(face, std::cos(a_from_b.pose.phi), std::sin(a_from_b.pose.phi), p.x, p.y);
}

// Less the farther from its partner, as Geman and McClure.
double robust_weight(double distance_m, double radius_m) {
  const double ratio = distance_m / (0.5 * radius_m);
  return 1.0 / ((1.0 + ratio * ratio) * (1.0 + ratio * ratio));
}

struct TilePull {  // of the walls around a tile: normal equations of its small motion in its own frame
  Eigen::Matrix3d information = Eigen::Vector3d(1e-4, 1e-4, 1e-2).asDiagonal();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
};

std::vector<TilePull> pulls(const PreparedGrid& a, const PreparedGrid& b, const BentGrid& bend, double radius_m) {
  std::vector<TilePull> result(b.tile_centres.size());
  for (const auto& sample : b.samples) {
    const int tile = b.tile_at(sample.x, sample.y);
    if (tile < 0) continue;
    const WallPoint face = in_a(b, bend, tile, sample);
    const auto match = a.index.nearest(face, radius_m, kLeastCosine);
    if (!match) continue;
    const Pose2& pose = bend.a_from_tile[static_cast<std::size_t>(tile)];
    const double c = std::cos(pose.phi), s = std::sin(pose.phi);
    const double nx = match->face.normal_x, ny = match->face.normal_y;
    const double error = (match->face.x - face.x) * nx + (match->face.y - face.y) * ny;
    const double lever_x = face.x - pose.x, lever_y = face.y - pose.y;
    const Eigen::Vector3d row(c * nx + s * ny, -s * nx + c * ny, ny * lever_x - nx * lever_y);
    const double weight = robust_weight(match->distance_m, radius_m) * kFaceWeight / (kFaceSigma_m * kFaceSigma_m);
    auto& pull = result[static_cast<std::size_t>(tile)];
    pull.information += weight * row * row.transpose();
    pull.gradient += weight * error * row;
  }
  return result;
}

// Neighbours hold each other at the middle between them.
std::vector<graph::Edge> springs(const PreparedGrid& b, double scale) {
  std::vector<graph::Edge> edges;
  for (const auto& [from, to] : b.neighbours) {
    const Eigen::Vector2d step =
        scale * (b.tile_centres[static_cast<std::size_t>(to)] - b.tile_centres[static_cast<std::size_t>(from)]);
    graph::Edge edge;
    edge.from = static_cast<std::uint32_t>(from) + 1;
    edge.to = static_cast<std::uint32_t>(to) + 1;
    edge.from_from_to = {step.x(), step.y(), 0.0};
    edge.information = grid_stiffness(step.x(), step.y(), 2);
    edges.push_back(edge);
  }
  return edges;
}

}  // namespace

PreparedGrid::PreparedGrid(matching::GridWalls grid_walls) : walls(std::move(grid_walls)), index(walls.faces) {
  const std::size_t stride = walls.faces.size() / kMostSamples + 1;
  for (std::size_t i = 0; i < walls.faces.size(); i += stride) samples.push_back(walls.faces[i]);
  sample_m = walls.cell_m * static_cast<double>(stride);
  const double width_m = walls.columns * walls.cell_m, height_m = walls.rows * walls.cell_m;
  tile_m = std::max(kGridTile_m, std::max(width_m, height_m) / kMostTiles);
  columns = static_cast<int>(width_m / tile_m) + 1;
  rows = static_cast<int>(height_m / tile_m) + 1;
  tile_number.assign(static_cast<std::size_t>(columns) * static_cast<std::size_t>(rows), -1);
  const auto mark = [&](double x_m, double y_m) {
    tile_number[static_cast<std::size_t>((y_m - walls.origin_y_m) / tile_m) * static_cast<std::size_t>(columns) +
                static_cast<std::size_t>((x_m - walls.origin_x_m) / tile_m)] = 0;
  };
  for (const auto& face : walls.faces) mark(face.x, face.y);
  for (int row = 0; row < walls.rows; ++row)
    for (int column = 0; column < walls.columns; ++column)
      if (walls.depth_m[static_cast<std::size_t>(row) * static_cast<std::size_t>(walls.columns) +
                        static_cast<std::size_t>(column)] > 0.0F)
        mark(walls.origin_x_m + (column + 0.5) * walls.cell_m, walls.origin_y_m + (row + 0.5) * walls.cell_m);
  const auto number = [&](int column, int row) -> int& {
    return tile_number[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
                       static_cast<std::size_t>(column)];
  };
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column) {
      if (number(column, row) < 0) continue;
      number(column, row) = static_cast<int>(tile_centres.size());
      tile_centres.emplace_back(walls.origin_x_m + (column + 0.5) * tile_m, walls.origin_y_m + (row + 0.5) * tile_m);
      for (const auto& [dx, dy] : {std::pair{-1, 0}, {-1, -1}, {0, -1}, {1, -1}})
        if (column + dx >= 0 && column + dx < columns && row + dy >= 0 && number(column + dx, row + dy) >= 0)
          neighbours.emplace_back(number(column + dx, row + dy), number(column, row));
    }
}

int PreparedGrid::tile_at(double x_m, double y_m) const {
  const double column = (x_m - walls.origin_x_m) / tile_m, row = (y_m - walls.origin_y_m) / tile_m;
  if (column < 0.0 || row < 0.0 || column >= columns || row >= rows) return -1;
  return tile_number[static_cast<std::size_t>(row) * static_cast<std::size_t>(columns) +
                     static_cast<std::size_t>(column)];
}

PlanarSimilarity refined(const PreparedGrid& a, const PreparedGrid& b, PlanarSimilarity a_from_b, double scale_range) {
  for (const double radius_m : kRefineRadii_m)
    for (int round = 0; round < kRefineRounds; ++round) {
      std::vector<std::pair<WallPoint, FaceIndex::Match>> matches;
      Eigen::Vector2d middle = Eigen::Vector2d::Zero();
      for (const auto& sample : b.samples) {
        const WallPoint face = placed(a_from_b, sample);
        if (const auto match = a.index.nearest(face, radius_m, kLeastCosine)) {
          matches.emplace_back(face, *match);
          middle += Eigen::Vector2d(face.x, face.y);
        }
      }
      if (matches.size() < kFewest) return a_from_b;
      middle /= static_cast<double>(matches.size());
      Eigen::Matrix4d normal =
          Eigen::Vector4d(1e-3, 1e-3, 1e-3, 1e-3 + kScalePrior * static_cast<double>(matches.size())).asDiagonal();
      Eigen::Vector4d right = Eigen::Vector4d::Zero();
      for (const auto& [face, match] : matches) {
        const double nx = match.face.normal_x, ny = match.face.normal_y, ux = face.x - middle.x(),
                     uy = face.y - middle.y();
        const Eigen::Vector4d row(nx, ny, ny * ux - nx * uy, nx * ux + ny * uy);
        const double weight = std::sqrt(robust_weight(match.distance_m, radius_m));
        normal += weight * row * row.transpose();
        right += weight * ((match.face.x - face.x) * nx + (match.face.y - face.y) * ny) * row;
      }
      Eigen::Vector4d step = normal.ldlt().solve(right);
      const double scale = std::clamp(a_from_b.scale * (1.0 + step[3]), 1.0 - scale_range, 1.0 + scale_range),
                   grown = scale / a_from_b.scale;
      const double c = grown * std::cos(step[2]), s = grown * std::sin(step[2]);
      const double x = a_from_b.pose.x - middle.x(), y = a_from_b.pose.y - middle.y();
      a_from_b.pose = {middle.x() + step[0] + c * x - s * y, middle.y() + step[1] + s * x + c * y,
                       wrap_angle(a_from_b.pose.phi + step[2])};
      a_from_b.scale = scale;
    }
  return a_from_b;
}

BentGrid bent(const PreparedGrid& a, const PreparedGrid& b, const PlanarSimilarity& a_from_b) {
  BentGrid bend;
  bend.a_from_b = a_from_b;
  for (const auto& centre : b.tile_centres) {
    const auto p = transformed(a_from_b, {static_cast<float>(centre.x()), static_cast<float>(centre.y())});
    bend.a_from_tile.emplace_back(p.x, p.y, a_from_b.pose.phi);
  }
  const std::vector<graph::Edge> held = springs(b, a_from_b.scale);
  graph::SolveOptions options;
  options.iterations = 4;  // partners are looked for again anyway
  for (int round = 0; round < kBendRounds; ++round) {
    const double radius_m = kFirstRadius_m + (kLastRadius_m - kFirstRadius_m) * round / (kBendRounds - 1);
    std::vector<graph::Edge> edges = held;
    std::vector<Pose2> poses{Pose2(0.0, 0.0, 0.0)};
    bend.information.clear();
    for (const TilePull& pull : pulls(a, b, bend, radius_m)) {
      const Pose2& pose = bend.a_from_tile[poses.size() - 1];
      const Eigen::Vector3d motion = pull.information.ldlt().solve(pull.gradient);
      graph::Edge edge;
      edge.to = static_cast<std::uint32_t>(poses.size());
      edge.from_from_to = compose(pose, Pose2(motion[0], motion[1], motion[2]));
      edge.information = pull.information;
      edges.push_back(edge);
      poses.push_back(pose);
      bend.information.push_back(pull.information);
    }
    const auto solution = graph::solve(poses, edges, options);
    bend.a_from_tile.assign(solution.poses.begin() + 1, solution.poses.end());
  }
  std::vector<Pose2> poses{Pose2(0.0, 0.0, 0.0)};
  poses.insert(poses.end(), bend.a_from_tile.begin(), bend.a_from_tile.end());
  for (const auto& edge : held) bend.chi2 += graph::chi2_of(edge, poses);
  return bend;
}

WallPoint in_a(const PreparedGrid& b, const BentGrid& bend, int tile, const WallPoint& face) {
  const Pose2& pose = bend.a_from_tile[static_cast<std::size_t>(tile)];
  const Eigen::Vector2d& centre = b.tile_centres[static_cast<std::size_t>(tile)];
  const double c = std::cos(pose.phi), s = std::sin(pose.phi);
  const double ux = bend.a_from_b.scale * (face.x - centre.x()), uy = bend.a_from_b.scale * (face.y - centre.y());
  return turned(face, c, s, pose.x + c * ux - s * uy, pose.y + s * ux + c * uy);
}

std::optional<WallPoint> in_b(const PreparedGrid& b, const BentGrid& bend, const WallPoint& face) {
  // The tile that would hold it unbent, then the one that the bent mesh says.
  double c = std::cos(bend.a_from_b.pose.phi), s = std::sin(bend.a_from_b.pose.phi);
  const auto apply = [&](double from_x, double from_y, double to_x, double to_y) {
    const double ux = (face.x - from_x) / bend.a_from_b.scale, uy = (face.y - from_y) / bend.a_from_b.scale;
    return turned(face, c, -s, to_x + c * ux + s * uy, to_y - s * ux + c * uy);
  };
  WallPoint found = apply(bend.a_from_b.pose.x, bend.a_from_b.pose.y, 0.0, 0.0);
  for (int round = 0; round < 2; ++round) {
    const int tile = b.tile_at(found.x, found.y);
    if (tile < 0) return std::nullopt;
    const Pose2& pose = bend.a_from_tile[static_cast<std::size_t>(tile)];
    const Eigen::Vector2d& centre = b.tile_centres[static_cast<std::size_t>(tile)];
    c = std::cos(pose.phi);
    s = std::sin(pose.phi);
    found = apply(pose.x, pose.y, centre.x(), centre.y());
  }
  return found;
}

}  // namespace mapweave::fusion
