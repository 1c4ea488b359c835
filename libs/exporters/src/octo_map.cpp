#include <mapweave/exporters/octo_map.h>

#include <mapweave/core/error.h>

#include <octomap/ColorOcTree.h>

#include <algorithm>
#include <cmath>
#include <sstream>

namespace mapweave::exporters {
namespace {

constexpr double kBytesPerNode = 64.0;  // with its share of the tables of children and all that the allocator adds
constexpr int kLevels = 16;             // of OctoMap's trees
constexpr octomap::key_type kMiddle = 1 << (kLevels - 1);

using Place = std::uint64_t;  // a key as one number: the order of what a picture teaches
Place place_of(const octomap::OcTreeKey& key) { return Place{key[0]} << 32 | Place{key[1]} << 16 | key[2]; }
octomap::OcTreeKey key_of(Place place) {
  return {static_cast<octomap::key_type>(place >> 32), static_cast<octomap::key_type>(place >> 16),
          static_cast<octomap::key_type>(place)};
}

octomap::ColorOcTreeNode::Color mixed(const octomap::ColorOcTreeNode::Color& a,
                                      const octomap::ColorOcTreeNode::Color& b) {
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
          for (unsigned axis = 0; axis < 3; ++axis)
            key[axis] = static_cast<octomap::key_type>((low[axis] >> 1) + kMiddle / 2 + steps[axis]);
          octomap::ColorOcTreeNode* known = result->search(key);
          const float log_odds =
              known == nullptr ? leaf->getLogOdds() : std::max(known->getLogOdds(), leaf->getLogOdds());
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

// Cells of a row or column of a grid as those of the tree: whose middles lie in each, or the one around its middle.
struct Keys {
  octomap::key_type first = 1, last = 0;
  bool empty() const { return last < first; }
};
std::vector<Keys> keys_along(double origin_m, double cell_m, std::int32_t count, double resolution_m) {
  constexpr double kMost = 2.0 * kMiddle - 1.0;
  std::vector<Keys> result(static_cast<std::size_t>(count));
  for (std::int32_t i = 0; i < count; ++i) {
    const double low = (origin_m + i * cell_m) / resolution_m, high = (origin_m + (i + 1) * cell_m) / resolution_m;
    double first = std::ceil(low - 0.5), last = std::ceil(high - 0.5) - 1.0;
    if (last < first) first = last = std::floor(0.5 * (low + high));
    first += kMiddle;
    last += kMiddle;
    if (first >= 0.0 && last <= kMost)
      result[static_cast<std::size_t>(i)] = {static_cast<octomap::key_type>(first),
                                             static_cast<octomap::key_type>(last)};
  }
  return result;
}

}  // namespace

struct OctoMapWriter::Tree {
  std::unique_ptr<octomap::ColorOcTree> tree;
  std::size_t most_nodes = 0, left_out = 0;
  bool finished = false, has_pictures = false;
  octomap::KeyRay ray;  // kept between calls: its memory is large

  bool learn(const octomap::point3d& camera, const std::vector<ColouredPoint>& points);
  bool learn(const MapSlab& slab);

 private:
  struct End {  // a cell that rays end in
    Place place = 0;
    std::uint32_t rgb = 0;
  };
  std::vector<End> ends_of(const std::vector<ColouredPoint>& points) const;
  std::vector<Place> free_before(const octomap::point3d& camera, const std::vector<End>& ends);
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

// One for each cell, in the mean colour of its points.
std::vector<OctoMapWriter::Tree::End> OctoMapWriter::Tree::ends_of(const std::vector<ColouredPoint>& points) const {
  std::vector<End> seen, ends;
  seen.reserve(points.size());
  octomap::OcTreeKey key;
  for (const auto& [point, rgb] : points) {
    MAPWEAVE_EXPECT(point.allFinite(), "a point is finite");
    if (tree->coordToKeyChecked(octomap::point3d(point.x(), point.y(), point.z()), key))
      seen.push_back({place_of(key), rgb});
  }
  std::stable_sort(seen.begin(), seen.end(), [](const End& a, const End& b) { return a.place < b.place; });
  for (std::size_t first = 0, last = 0; first < seen.size(); first = last) {
    std::uint64_t sums[3] = {0, 0, 0};
    for (; last < seen.size() && seen[last].place == seen[first].place; ++last)
      for (int channel = 0; channel < 3; ++channel) sums[channel] += seen[last].rgb >> (16 - 8 * channel) & 0xff;
    std::uint32_t rgb = 0;
    for (const std::uint64_t sum : sums) rgb = rgb << 8 | static_cast<std::uint32_t>(sum / (last - first));
    ends.push_back({seen[first].place, rgb});
  }
  return ends;
}

// The cells between the camera and the ends, sorted, without those that are ends themselves.
std::vector<Place> OctoMapWriter::Tree::free_before(const octomap::point3d& camera, const std::vector<End>& ends) {
  constexpr std::size_t kAtOnce = 1 << 20;  // many rays pass through the same cells
  std::vector<Place> free;
  std::size_t unique = 0;
  const auto compact = [&] {
    std::sort(free.begin(), free.end());
    free.erase(std::unique(free.begin(), free.end()), free.end());
    unique = free.size();
  };
  for (const End& end : ends) {
    if (!tree->computeRayKeys(camera, tree->keyToCoord(key_of(end.place)), ray)) continue;
    for (const octomap::OcTreeKey& cell : ray) free.push_back(place_of(cell));
    if (free.size() > 2 * unique + kAtOnce) compact();
  }
  compact();
  auto end = ends.begin();
  free.erase(std::remove_if(free.begin(), free.end(),
                            [&](Place place) {
                              while (end != ends.end() && end->place < place) ++end;
                              return end != ends.end() && end->place == place;
                            }),
             free.end());
  return free;
}

// False where there is no memory for all of it.
bool OctoMapWriter::Tree::learn(const octomap::point3d& camera, const std::vector<ColouredPoint>& points) {
  const std::vector<End> ends = ends_of(points);
  for (const Place place : free_before(camera, ends)) {
    tree->updateNode(key_of(place), false);
    if (tree->size() > most_nodes) return false;
  }
  for (const End& end : ends) {
    octomap::ColorOcTreeNode* node = tree->updateNode(key_of(end.place), true);
    const octomap::ColorOcTreeNode::Color colour(static_cast<std::uint8_t>(end.rgb >> 16),
                                                 static_cast<std::uint8_t>(end.rgb >> 8),
                                                 static_cast<std::uint8_t>(end.rgb));
    node->setColor(node->isColorSet() ? mixed(node->getColor(), colour) : colour);
    if (tree->size() > most_nodes) return false;
  }
  return true;
}

// False where there is no memory for all of it.
bool OctoMapWriter::Tree::learn(const MapSlab& slab) {
  const OccupancyGrid& grid = slab.grid;
  const double resolution_m = tree->getResolution();
  const std::vector<Keys> columns = keys_along(grid.origin_x_m, grid.resolution_m, grid.columns, resolution_m),
                          rows = keys_along(grid.origin_y_m, grid.resolution_m, grid.rows, resolution_m);
  const auto height = static_cast<octomap::key_type>(std::floor(slab.height_m / resolution_m) + kMiddle);
  const auto put = [&](const octomap::OcTreeKey& key, float log_odds) {
    const octomap::ColorOcTreeNode* known = tree->search(key);
    if (known == nullptr || known->getLogOdds() < log_odds) tree->setNodeValue(key, log_odds, true);
  };
  for (std::int32_t row = 0; row < grid.rows; ++row) {
    for (std::int32_t column = 0; column < grid.columns; ++column) {
      const std::int16_t units = grid.at(column, row);
      if (units == OccupancyGrid::kUnknown) continue;
      const auto log_odds = std::clamp(static_cast<float>(units / OccupancyGrid::kUnitsPerNat),
                                       tree->getClampingThresMinLog(), tree->getClampingThresMaxLog());
      const Keys &xs = columns[static_cast<std::size_t>(column)], &ys = rows[static_cast<std::size_t>(row)];
      for (unsigned x = xs.first; x <= xs.last; ++x)
        for (unsigned y = ys.first; y <= ys.last; ++y)
          put({static_cast<octomap::key_type>(x), static_cast<octomap::key_type>(y), height}, log_odds);
    }
    if (tree->size() > most_nodes) return false;
  }
  return true;
}

void OctoMapWriter::add(const MapSlab& slab) {
  MAPWEAVE_EXPECT(!tree_->finished && !tree_->has_pictures, "slabs come before pictures");
  MAPWEAVE_EXPECT(std::isfinite(slab.height_m), "a slab has a height");
  const OccupancyGrid& grid = slab.grid;
  octomap::OcTreeKey key;
  const auto is_inside = [&](double x_m, double y_m) {
    return tree_->tree->coordToKeyChecked(x_m, y_m, slab.height_m, key);
  };
  for (std::int32_t row = 0; row < grid.rows; ++row)
    for (std::int32_t column = 0; column < grid.columns; ++column)
      if (grid.at(column, row) != OccupancyGrid::kUnknown &&
          !is_inside(grid.origin_x_m + (column + 0.5) * grid.resolution_m,
                     grid.origin_y_m + (row + 0.5) * grid.resolution_m))
        ++tree_->left_out;
  if (!is_inside(0.0, 0.0)) return;
  while (!tree_->learn(slab)) tree_->tree = coarser(*tree_->tree);
}

void OctoMapWriter::add(const Eigen::Vector3d& camera_in_map, const std::vector<ColouredPoint>& points_in_map) {
  MAPWEAVE_EXPECT(!tree_->finished && camera_in_map.allFinite(), "a camera stands somewhere before the end");
  const auto inside = [&](const octomap::point3d& place) {
    octomap::OcTreeKey key;
    return tree_->tree->coordToKeyChecked(place, key);
  };
  const octomap::point3d camera(static_cast<float>(camera_in_map.x()), static_cast<float>(camera_in_map.y()),
                                static_cast<float>(camera_in_map.z()));
  if (!inside(camera)) {
    tree_->left_out += points_in_map.size();
    return;
  }
  tree_->has_pictures = true;
  for (const auto& [point, rgb] : points_in_map) tree_->left_out += inside({point.x(), point.y(), point.z()}) ? 0 : 1;
  while (!tree_->learn(camera, points_in_map)) tree_->tree = coarser(*tree_->tree);
}

OctoMapFiles OctoMapWriter::finish() {
  MAPWEAVE_EXPECT(!tree_->finished, "the end comes once");
  tree_->finished = true;
  octomap::ColorOcTree& tree = *tree_->tree;
  if (tree.size() > 0) tree.updateInnerOccupancy();  // colours of larger cells; OctoMap's fails on an empty tree
  tree.prune();
  OctoMapFiles files;
  std::ostringstream ot;
  tree.write(ot);
  files.ot = ot.str();
  tree.toMaxLikelihood();
  tree.prune();
  // By the tree's own hand its type would be ColorOcTree, which readers of .bt do not know; the bytes are the same.
  std::ostringstream bt;
  bt << "# Octomap OcTree binary file\n# (feel free to add / change comments, but leave the first line as it "
        "is!)\n#\nid OcTree\nsize "
     << tree.size() << "\nres " << tree.getResolution() << "\ndata\n";
  tree.writeBinaryData(bt);
  files.bt = bt.str();
  return files;
}

}  // namespace mapweave::exporters
