#pragma once
// What one submap saw of the plane, small enough to be kept for all submaps of a team: where its walls are, and where
// its rays went through.

#include <mapweave/matching/submap_model.h>

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <list>
#include <map>
#include <memory>
#include <mutex>
#include <vector>

namespace mapweave::fusion {

// Of a place; of several submaps the largest counts. Wall: within 0.12 m. Through: nothing but free space within 0.2 m.
// Beside a wall: seen, with a wall within 0.2 m. In part: seen, with cells within 0.2 m that were not.
enum class Seen : std::uint8_t { not_at_all, in_part, through, beside_wall, wall };

// Cells of 0.1 m in the submap's frame, in tiles that are kept only where something was seen.
class WallSight {
 public:
  explicit WallSight(const matching::SubmapModel& model);
  Seen at(double x_m, double y_m) const {
    const int quarter_x = matching::cell_of(x_m, kInverseQuarter), quarter_y = matching::cell_of(y_m, kInverseQuarter);
    const int x = tile_of(quarter_x, 2), y = tile_of(quarter_y, 2), tx = tile_of(x, kTile), ty = tile_of(y, kTile);
    if (!index_.contains(tx, ty)) return Seen::not_at_all;
    const std::uint32_t index = index_.at(tx, ty);
    if (index == 0) return Seen::not_at_all;
    const unsigned cell = tiles_[index - 1U][static_cast<std::size_t>((y - ty * kTile) * kTile + x - tx * kTile)];
    const auto quarter = static_cast<unsigned>((quarter_x & 1) + 2 * (quarter_y & 1));
    return (cell >> quarter & 1U) != 0 ? Seen::wall : static_cast<Seen>(cell >> 4U);
  }
  // Rectangles of the submap's frame, none larger than 1.6 m, outside of which nothing is a wall.
  struct Block {
    Eigen::Vector2d middle, half;  // half: of its sides
  };
  const std::vector<Block>& wall_blocks() const { return wall_blocks_; }
  std::size_t bytes() const {
    return tiles_.size() * sizeof(Tile) + index_.bytes() + wall_blocks_.capacity() * sizeof(Block);
  }

 private:
  void find_wall_blocks();
  static constexpr int kTile = 16;  // cells along a side
  static constexpr double kInverseQuarter = 1.0 / matching::WallField::kResolution;
  // `side`: a power of two.
  static int tile_of(int cell, int side) { return (cell - (cell & (side - 1))) / side; }
  // Of a cell: bits 0 to 3 whether its quarters are within 0.12 m of a wall, above them what rays said.
  using Tile = std::array<std::uint8_t, kTile * kTile>;
  matching::Raster<std::uint32_t> index_;  // 0: nothing was seen, else number of the tile and 1
  std::vector<Tile> tiles_;
  std::vector<Block> wall_blocks_;  // of each tile that holds walls
};

// Keeps at most so many bytes, those used last. Not for several threads.
class WallSightCache {
 public:
  explicit WallSightCache(std::size_t most_bytes) : most_bytes_(most_bytes) {}
  std::shared_ptr<const WallSight> find(std::size_t submap);  // none where it is not kept
  void add(std::size_t submap, std::shared_ptr<const WallSight> sight);
  bool is_full() const { return is_full_; }  // something was given up already

 private:
  std::size_t most_bytes_, bytes_ = 0;
  bool is_full_ = false;
  std::list<std::size_t> recent_;
  std::map<std::size_t, std::pair<std::shared_ptr<const WallSight>, std::list<std::size_t>::iterator>> entries_;
};

// Of submaps by their content, for who merges the same maps again. What a merge did not use is given up when the next
// one begins. Thread-safe.
class KeptSights {
 public:
  void begin();                                                // a merge
  std::shared_ptr<const WallSight> find(const Hash& content);  // none where it is not kept
  void add(const Hash& content, std::shared_ptr<const WallSight> sight);

 private:
  struct Entry {
    std::shared_ptr<const WallSight> sight;
    std::uint64_t used_by;  // a merge
  };
  std::mutex mutex_;
  std::uint64_t merge_ = 0;
  std::map<Hash, Entry> entries_;
};

}  // namespace mapweave::fusion
