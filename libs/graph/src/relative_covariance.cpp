#include <mapweave/core/error.h>
#include <mapweave/graph/relative_covariance.h>
#include <mapweave/maps/alignment.h>

#include <Eigen/SparseCholesky>
#include <map>

namespace mapweave::graph {
namespace {

constexpr double kLoosest = 1e-4;  // information that every node has: 100 m, 100 rad

using Columns = Eigen::Matrix<double, Eigen::Dynamic, 3>;

}  // namespace

struct RelativeCovariance::State {
  std::vector<Pose2> poses;
  Eigen::SimplicialLDLT<Eigen::SparseMatrix<double>> factor;
  std::map<std::uint32_t, Columns> columns;

  const Columns& columns_of(std::uint32_t node) {
    const auto known = columns.find(node);
    if (known != columns.end()) return known->second;
    Columns unit = Columns::Zero(static_cast<Eigen::Index>(3 * poses.size()), 3);
    unit.middleRows<3>(3 * static_cast<Eigen::Index>(node)) = Eigen::Matrix3d::Identity();
    return columns.emplace(node, factor.solve(unit)).first->second;
  }
};

RelativeCovariance::RelativeCovariance(const std::vector<Pose2>& poses, const std::vector<Edge>& edges,
                                       const std::vector<double>& weights)
    : state_(std::make_unique<State>()) {
  MAPWEAVE_EXPECT(weights.size() == edges.size(), "one weight an edge");
  state_->poses = poses;
  std::vector<Eigen::Triplet<double>> entries;
  entries.reserve(edges.size() * 36 + poses.size() * 3);
  const auto add = [&](std::uint32_t row, std::uint32_t column, const Eigen::Matrix3d& block) {
    for (int i = 0; i < 3; ++i)
      for (int j = 0; j < 3; ++j)
        entries.emplace_back(static_cast<int>(3 * row) + i, static_cast<int>(3 * column) + j, block(i, j));
  };
  for (std::size_t k = 0; k < edges.size(); ++k) {
    const Edge& edge = edges[k];
    if (weights[k] < 1e-3) continue;
    // Motions are of each node in its own frame: error = motion of `to` - motion of `from`, carried to where `to` is.
    const Eigen::Matrix3d carry = -adjoint(mapweave::between(poses[edge.to], poses[edge.from]));
    const Eigen::Matrix3d information = weights[k] * edge.information;
    add(edge.from, edge.from, carry.transpose() * information * carry);
    add(edge.from, edge.to, carry.transpose() * information);
    add(edge.to, edge.from, information * carry);
    add(edge.to, edge.to, information);
  }
  for (std::uint32_t i = 0; i < poses.size(); ++i) add(i, i, kLoosest * Eigen::Matrix3d::Identity());
  const auto size = static_cast<Eigen::Index>(3 * poses.size());
  Eigen::SparseMatrix<double> information(size, size);
  information.setFromTriplets(entries.begin(), entries.end());
  state_->factor.compute(information);
  MAPWEAVE_EXPECT(state_->factor.info() == Eigen::Success, "the information of a pose graph is positive definite");
}
RelativeCovariance::~RelativeCovariance() = default;
RelativeCovariance::RelativeCovariance(RelativeCovariance&&) noexcept = default;
RelativeCovariance& RelativeCovariance::operator=(RelativeCovariance&&) noexcept = default;

Eigen::Matrix3d RelativeCovariance::between(std::uint32_t from, std::uint32_t to) {
  MAPWEAVE_EXPECT(from < state_->poses.size() && to < state_->poses.size(), "nodes are of the graph");
  if (from == to) return Eigen::Matrix3d::Zero();
  const Eigen::Matrix3d carry = adjoint(mapweave::between(state_->poses[to], state_->poses[from]));
  const auto row = [](std::uint32_t node) { return 3 * static_cast<Eigen::Index>(node); };
  const Columns& of_from = state_->columns_of(from);
  const Eigen::Matrix3d from_from = of_from.middleRows<3>(row(from)), to_from = of_from.middleRows<3>(row(to));
  const Eigen::Matrix3d to_to = state_->columns_of(to).middleRows<3>(row(to));
  const Eigen::Matrix3d covariance =
      to_to + carry * from_from * carry.transpose() - to_from * carry.transpose() - carry * to_from.transpose();
  return 0.5 * (covariance + covariance.transpose());
}

}  // namespace mapweave::graph
