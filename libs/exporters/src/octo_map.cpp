#include <mapweave/exporters/octo_map.h>

#include <mapweave/core/error.h>

#include <octomap/ColorOcTree.h>

#include <algorithm>
#include <sstream>

namespace mapweave::exporters {
namespace {

constexpr double kBytesPerNode = 64.0;  // with its share of the tables of children and all that the allocator adds
constexpr int kLevels = 16;             // of OctoMap's trees
constexpr octomap::key_type kMiddle = 1 << (kLevels - 1);

using Place = std::uint64_t;  // a key as one number: the order of what a picture teaches
Place place_of(const octomap::OcTreeKey& key) { return Place{key[0]} << 32 | Place{key[1]} << 16 | key[2]; }
octomap::OcTreeKey key_of(Place place) {
  return {static_cast<octomap::key_type>(place >> 32), static_cast<octomap::key_type>(place >> 16), static_cast<octomap::key_type>(place)};
}

octomap::ColorOcTreeNode::Color mixed(const octomap::ColorOcTreeNode::Color& a, const octomap::ColorOcTreeNode::Color& b) {
  const auto middle = [](std::uint8_t x, std::uint8_t y) { return static_cast<std::uint8_t>((x + y + 1) / 2); };
  return {middle(a.r, b.r), middle(a.g, b.g), middle(a.b, b.b)};
}

// Cells twice as large: occupied where one of the eight was, else free where one was.
std::unique_ptr<octomap::ColorOcTree> coarser(const octomap::ColorOcTree& tree) {
  auto result = std::make_unique<octomap::ColorOcTree>(2.0 * tree.getResolution());
  for (auto leaf = tree.begin_leafs(), end = tree.end_leafs(); leaf != end; ++leaf) {
    // A leaf of several cells is as large in the new tree: half as many a side.
    const int side = leaf.getDepth() >= kLevels - 1u ? 1 : 1 << (kLevels - 1 - static_cast<int>(leaf.getDepth()));
    const octomap::OcTreeKey low = leaf.getIndexKey();
    octomap::OcTreeKey key;
    for (int x = 0; x < side; ++x)
      for (int y = 0; y < side; ++y)
        for (int z = 0; z < side; ++z) {
          const int steps[3] = {x, y, z};
          for (unsigned axis = 0; axis < 3; ++axis) key[axis] = static_cast<octomap::key_type>((low[axis] >> 1) + kMiddle / 2 + steps[axis]);
          octomap::ColorOcTreeNode* known = result->search(key);
          const float log_odds = known == nullptr ? leaf->getLogOdds() : std::max(known->getLogOdds(), leaf->getLogOdds());
          const bool was_coloured = known != nullptr && known->isColorSet();
          const auto colour = was_coloured && leaf->isColorSet() ? mixed(known->getColor(), leaf->getColor())
                              : was_coloured                     ? known->getColor()
                                                                 : leaf->getColor();
          result->setNodeValue(key, log_odds)->setColor(colour);
        }
  }
  result->updateInnerOccupancy();
  result->prune();
  return result;
}

}  // namespace

struct OctoMapWriter::Tree {
  std::unique_ptr<octomap::ColorOcTree> tree;
  std::size_t most_nodes = 0, left_out = 0;
  bool finished = false;
  octomap::KeyRay ray;  // kept between calls: its memory is large
  std::vector<Place> free;

  struct Seen {
    Place place = 0;
    std::uint32_t rgb = 0;
  };
};

OctoMapWriter::OctoMapWriter(const OctoMapOptions& options) : tree_(new Tree) {
  MAPWEAVE_EXPECT(options.resolution_m > 0.0, "cells have a size");
  tree_->tree = std::make_unique<octomap::ColorOcTree>(options.resolution_m);
  tree_->most_nodes = static_cast<std::size_t>(std::max(1000.0, 1e6 * options.memory_mb / kBytesPerNode));
}
OctoMapWriter::~OctoMapWriter() = default;

double OctoMapWriter::resolution_m() const { return tree_->tree->getResolution(); }
std::size_t OctoMapWriter::nodes() const { return tree_->tree->size(); }
std::size_t OctoMapWriter::most_nodes() const { return tree_->most_nodes; }
std::size_t OctoMapWriter::left_out() const { return tree_->left_out; }

void OctoMapWriter::add(const Eigen::Vector3d& camera_in_map, const std::vector<ColouredPoint>& points_in_map) {
  MAPWEAVE_EXPECT(!tree_->finished && camera_in_map.allFinite(), "a camera stands somewhere before the end");
  octomap::ColorOcTree& tree = *tree_->tree;
  const octomap::point3d origin(static_cast<float>(camera_in_map.x()), static_cast<float>(camera_in_map.y()),
                                static_cast<float>(camera_in_map.z()));
  octomap::OcTreeKey key;
  const bool inside = tree.coordToKeyChecked(origin, key);
  std::vector<Tree::Seen> seen;
  seen.reserve(points_in_map.size());
  for (const auto& [point, rgb] : points_in_map) {
    MAPWEAVE_EXPECT(point.allFinite(), "a point is finite");
    if (inside && tree.coordToKeyChecked(octomap::point3d(point.x(), point.y(), point.z()), key))
      seen.push_back({place_of(key), rgb});
    else
      ++tree_->left_out;
  }
  std::stable_sort(seen.begin(), seen.end(), [](const auto& a, const auto& b) { return a.place < b.place; });
  std::vector<Tree::Seen> ends;  // one for each cell, in the mean colour of its points
  for (std::size_t first = 0, last = 0; first < seen.size(); first = last) {
    std::uint64_t sums[3] = {0, 0, 0};
    for (; last < seen.size() && seen[last].place == seen[first].place; ++last)
      for (int axis = 0; axis < 3; ++axis) sums[axis] += seen[last].rgb >> (16 - 8 * axis) & 0xff;
    std::uint32_t rgb = 0;
    for (const std::uint64_t sum : sums) rgb = rgb << 8 | static_cast<std::uint32_t>(sum / (last - first));
    ends.push_back({seen[first].place, rgb});
  }

  const auto is_end = [&](Place place) {
    const auto at = std::lower_bound(ends.begin(), ends.end(), place, [](const Tree::Seen& end, Place p) { return end.place < p; });
    return at != ends.end() && at->place == place;
  };
  std::vector<Place>& free = tree_->free;
  free.clear();
  for (const Tree::Seen& end : ends) {
    if (!tree.computeRayKeys(origin, tree.keyToCoord(key_of(end.place)), tree_->ray)) continue;
    for (const octomap::OcTreeKey& cell : tree_->ray) free.push_back(place_of(cell));
  }
  std::sort(free.begin(), free.end());
  free.erase(std::unique(free.begin(), free.end()), free.end());
  for (const Place place : free)
    if (!is_end(place)) tree.updateNode(key_of(place), false);
  for (const Tree::Seen& end : ends) {
    octomap::ColorOcTreeNode* node = tree.updateNode(key_of(end.place), true);
    const octomap::ColorOcTreeNode::Color colour(static_cast<std::uint8_t>(end.rgb >> 16), static_cast<std::uint8_t>(end.rgb >> 8),
                                                 static_cast<std::uint8_t>(end.rgb));
    node->setColor(node->isColorSet() ? mixed(node->getColor(), colour) : colour);
  }
  while (tree_->tree->size() > tree_->most_nodes) tree_->tree = coarser(*tree_->tree);
}

OctoMapFiles OctoMapWriter::finish() {
  MAPWEAVE_EXPECT(!tree_->finished, "the end comes once");
  tree_->finished = true;
  octomap::ColorOcTree& tree = *tree_->tree;
  tree.updateInnerOccupancy();  // colours of larger cells
  tree.prune();
  OctoMapFiles files;
  std::ostringstream ot;
  tree.write(ot);
  files.ot = ot.str();
  tree.toMaxLikelihood();
  tree.prune();
  // By the tree's own hand its type would be ColorOcTree, which readers of .bt do not know; the bytes are the same.
  std::ostringstream bt;
  bt << "# Octomap OcTree binary file\n# (feel free to add / change comments, but leave the first line as it is!)\n#\nid OcTree\nsize "
     << tree.size() << "\nres " << tree.getResolution() << "\ndata\n";
  tree.writeBinaryData(bt);
  files.bt = bt.str();
  return files;
}

}  // namespace mapweave::exporters
