#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/exporters/octo_map.h>

#include <octomap/ColorOcTree.h>
#include <octomap/OcTree.h>

#include <limits>
#include <sstream>

namespace mapweave::exporters {
namespace {

const Eigen::Vector3d kCamera(0.1, 0.2, 1.0);

// What a camera at kCamera sees of a wall at x = 3.02, one metre to each side.
std::vector<ColouredPoint> wall() {
  std::vector<ColouredPoint> points;
  for (float y = -1.0F; y < 1.0F; y += 0.02F)
    for (float z = 0.2F; z < 1.8F; z += 0.02F) points.push_back({{3.02F, y, z}, 0x204080});
  return points;
}

std::unique_ptr<octomap::OcTree> read_bt(const std::string& bytes) {
  std::istringstream stream(bytes);
  auto tree = std::make_unique<octomap::OcTree>(1.0);
  return tree->readBinary(stream) ? std::move(tree) : nullptr;
}

std::unique_ptr<octomap::ColorOcTree> read_ot(const std::string& bytes) {
  std::istringstream stream(bytes);
  std::unique_ptr<octomap::AbstractOcTree> any(octomap::AbstractOcTree::read(stream));
  auto* tree = dynamic_cast<octomap::ColorOcTree*>(any.get());
  if (tree != nullptr) any.release();
  return std::unique_ptr<octomap::ColorOcTree>(tree);
}

enum class Cell { unknown, free, occupied };
template <class Tree>
Cell at(const Tree& tree, double x, double y, double z) {
  const auto* node = tree.search(x, y, z);
  if (node == nullptr) return Cell::unknown;
  return tree.isNodeOccupied(node) ? Cell::occupied : Cell::free;
}

template <class Tree>
void expect_the_wall(const Tree& tree) {
  for (const double y : {-0.9, -0.3, 0.4, 0.9})
    for (const double z : {0.5, 1.0, 1.5}) {
      EXPECT_EQ(at(tree, 3.02, y, z), Cell::occupied) << y << " " << z;
      EXPECT_EQ(at(tree, 3.2, y, z), Cell::unknown) << "behind it";
    }
  EXPECT_EQ(at(tree, 1.5, 0.2, 1.0), Cell::free);
  EXPECT_EQ(at(tree, 2.8, 0.5, 1.2), Cell::free);
  EXPECT_EQ(at(tree, 1.0, 2.0, 1.0), Cell::unknown) << "nobody looked there";
}

TEST(OctoMapWriter, writes_trees_that_octomap_reads) {
  OctoMapWriter writer({0.05, 100.0});
  for (int i = 0; i < 3; ++i) writer.add(kCamera, wall());
  EXPECT_EQ(writer.resolution_m(), 0.05);
  const OctoMapFiles files = writer.finish();
  const auto bt = read_bt(files.bt);
  ASSERT_NE(bt, nullptr);
  EXPECT_EQ(bt->getResolution(), 0.05);
  expect_the_wall(*bt);
  const auto ot = read_ot(files.ot);
  ASSERT_NE(ot, nullptr);
  expect_the_wall(*ot);
  const auto colour = ot->search(3.02, 0.4, 1.0)->getColor();
  EXPECT_EQ(colour, octomap::ColorOcTreeNode::Color(0x20, 0x40, 0x80));
}

TEST(OctoMapWriter, writes_a_tree_of_nothing_where_nothing_is_known) {
  OctoMapWriter writer;
  MapSlab slab;
  slab.grid.columns = slab.grid.rows = 1;
  slab.grid.log_odds = {OccupancyGrid::kUnknown};
  writer.add(slab);
  const OctoMapFiles files = writer.finish();
  EXPECT_NE(read_ot(files.ot), nullptr);
  EXPECT_FALSE(files.bt.empty());
}

TEST(OctoMapWriter, lets_what_went_away_go) {
  OctoMapWriter writer({0.05, 100.0});
  writer.add(kCamera, {{{1.5F, 0.2F, 1.0F}, 0xff0000}});  // somebody stood there once
  for (int i = 0; i < 5; ++i) writer.add(kCamera, wall());
  const auto tree = read_bt(writer.finish().bt);
  ASSERT_NE(tree, nullptr);
  EXPECT_EQ(at(*tree, 1.5, 0.2, 1.0), Cell::free);
}

TEST(OctoMapWriter, doubles_its_cells_where_memory_is_short_and_keeps_the_wall) {
  OctoMapWriter writer({0.02, 1.0});
  for (int i = 0; i < 2; ++i) writer.add(kCamera, wall());
  EXPECT_LE(writer.nodes(), writer.most_nodes());
  EXPECT_GT(writer.resolution_m(), 0.02);
  EXPECT_LE(writer.resolution_m(), 0.08);
  const OctoMapFiles files = writer.finish();
  const auto bt = read_bt(files.bt);
  ASSERT_NE(bt, nullptr);
  expect_the_wall(*bt);
  const auto ot = read_ot(files.ot);
  ASSERT_NE(ot, nullptr);
  const auto colour = ot->search(3.02, 0.4, 1.0)->getColor();
  EXPECT_EQ(colour, octomap::ColorOcTreeNode::Color(0x20, 0x40, 0x80));
}

TEST(OctoMapWriter, gives_the_same_bytes_again) {
  std::string before;
  for (int run = 0; run < 2; ++run) {
    OctoMapWriter writer({0.05, 100.0});
    writer.add(kCamera, wall());
    writer.add({0.5, -0.4, 0.9}, wall());
    const OctoMapFiles files = writer.finish();
    if (run == 1) {
      EXPECT_TRUE(before == files.bt + files.ot);
    }
    before = files.bt + files.ot;
  }
}

TEST(OctoMapWriter, leaves_out_what_its_keys_cannot_name) {
  OctoMapWriter writer({0.05, 100.0});
  writer.add(kCamera, {{{5000.0F, 0.0F, 0.0F}, 0}, {{1.0F, 0.0F, 0.0F}, 0}});
  EXPECT_EQ(writer.left_out(), 1U);
  writer.add({1e9, 0.0, 0.0}, {{{1.0F, 0.0F, 0.0F}, 0}});
  EXPECT_EQ(writer.left_out(), 2U);
  EXPECT_THROW(writer.add(kCamera, {{{std::numeric_limits<float>::infinity(), 0.0F, 0.0F}, 0}}), ContractViolation);
  writer.finish();
  EXPECT_THROW(writer.add(kCamera, {}), ContractViolation);
  EXPECT_THROW(writer.finish(), ContractViolation);
}

}  // namespace
}  // namespace mapweave::exporters
