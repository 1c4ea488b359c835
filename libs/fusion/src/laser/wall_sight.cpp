#include "wall_sight.h"

#include <algorithm>

namespace mapweave::fusion {
namespace {

using matching::cell_of;
using matching::Sight;
using matching::SubmapModel;

constexpr std::uint8_t kNearWall = 60;  // likelihood 0.12 m from a wall
constexpr int kClear = 2;               // cells around that must be free

// What is seen of each cell, by all cells within kClear of it: along rows, then along columns.
matching::Raster<Seen> seen_around(const matching::Raster<Sight>& sight) {
  const int x0 = sight.first_x(), y0 = sight.first_y(), x1 = x0 + sight.width() - 1, y1 = y0 + sight.height() - 1;
  constexpr std::uint8_t kUnknown = 1, kWall = 2;
  matching::Raster<std::uint8_t> rows(x0, y0, x1, y1, 0);
  matching::Raster<Seen> seen(x0, y0, x1, y1);
  for (int y = y0; y <= y1; ++y)
    for (int x = x0; x <= x1; ++x)
      for (int i = -kClear; i <= kClear; ++i) {
        const Sight there = sight.get(x + i, y);
        if (there != Sight::free) rows.at(x, y) |= there == Sight::wall ? kWall : kUnknown;
      }
  for (int y = y0; y <= y1; ++y)
    for (int x = x0; x <= x1; ++x) {
      if (sight.at(x, y) == Sight::unknown) continue;
      std::uint8_t around = 0;
      for (int j = -kClear; j <= kClear; ++j) around |= rows.contains(x, y + j) ? rows.at(x, y + j) : kUnknown;
      seen.at(x, y) = (around & kWall) != 0 ? Seen::beside_wall : around != 0 ? Seen::in_part : Seen::through;
    }
  return seen;
}

}  // namespace

WallSight::WallSight(const SubmapModel& model) {
  static_assert(matching::WallField::kResolution * 2 == SubmapModel::kSightResolution, "a cell has four quarters");
  const auto& walls = model.field().likelihood();
  const auto& sight = model.sight();
  if (walls.empty() && sight.empty()) return;
  const auto half = [](int v) { return tile_of(v, 2); };
  int x0 = sight.first_x(), y0 = sight.first_y(), x1 = x0 + sight.width() - 1, y1 = y0 + sight.height() - 1;
  if (!walls.empty()) {
    const int wx0 = half(walls.first_x()), wy0 = half(walls.first_y()), wx1 = half(walls.first_x() + walls.width() - 1),
              wy1 = half(walls.first_y() + walls.height() - 1);
    x0 = sight.empty() ? wx0 : std::min(x0, wx0);
    y0 = sight.empty() ? wy0 : std::min(y0, wy0);
    x1 = sight.empty() ? wx1 : std::max(x1, wx1);
    y1 = sight.empty() ? wy1 : std::max(y1, wy1);
  }
  index_ =
      matching::Raster<std::uint32_t>(tile_of(x0, kTile), tile_of(y0, kTile), tile_of(x1, kTile), tile_of(y1, kTile));
  const auto cell = [&](int x, int y) -> std::uint8_t& {
    const int tx = tile_of(x, kTile), ty = tile_of(y, kTile);
    std::uint32_t& index = index_.at(tx, ty);
    if (index == 0) {
      tiles_.emplace_back();
      tiles_.back().fill(0);
      index = static_cast<std::uint32_t>(tiles_.size());
    }
    return tiles_[index - 1U][static_cast<std::size_t>((y - ty * kTile) * kTile + x - tx * kTile)];
  };
  if (!sight.empty()) {
    const auto seen = seen_around(sight);
    for (int y = sight.first_y(); y < sight.first_y() + sight.height(); ++y)
      for (int x = sight.first_x(); x < sight.first_x() + sight.width(); ++x)
        if (sight.at(x, y) != Sight::unknown)
          cell(x, y) = static_cast<std::uint8_t>(static_cast<unsigned>(seen.at(x, y)) << 4U);
  }
  walls.for_each_run([&](int first, int y, const std::uint8_t* cells, int count) {
    for (int x = first; x < first + count; ++x)
      if (cells[x - first] > kNearWall)
        cell(half(x), half(y)) |= static_cast<std::uint8_t>(1U << static_cast<unsigned>((x & 1) + 2 * (y & 1)));
  });
  find_wall_blocks();
}

void WallSight::find_wall_blocks() {
  constexpr double kCell_m = SubmapModel::kSightResolution;
  for (int ty = index_.first_y(); ty < index_.first_y() + index_.height(); ++ty)
    for (int tx = index_.first_x(); tx < index_.first_x() + index_.width(); ++tx) {
      const std::uint32_t index = index_.at(tx, ty);
      if (index == 0) continue;
      const Tile& tile = tiles_[index - 1U];
      Eigen::Array2i low(kTile, kTile), high(-1, -1);
      for (int y = 0; y < kTile; ++y)
        for (int x = 0; x < kTile; ++x)
          if ((tile[static_cast<std::size_t>(y * kTile + x)] & 15U) != 0) {
            low = low.min(Eigen::Array2i(x, y));
            high = high.max(Eigen::Array2i(x, y));
          }
      if (high.x() < 0) continue;
      const Eigen::Array2d from = (low + Eigen::Array2i(tx, ty) * kTile).cast<double>() * kCell_m,
                           sides = (high + 1 - low).cast<double>() * kCell_m;
      wall_blocks_.push_back({from + 0.5 * sides, 0.5 * sides});
    }
}

std::shared_ptr<const WallSight> WallSightCache::find(std::size_t submap) {
  const auto found = entries_.find(submap);
  if (found == entries_.end()) return nullptr;
  recent_.splice(recent_.begin(), recent_, found->second.second);
  return found->second.first;
}

void WallSightCache::add(std::size_t submap, std::shared_ptr<const WallSight> sight) {
  recent_.push_front(submap);
  bytes_ += sight->bytes();
  entries_[submap] = {std::move(sight), recent_.begin()};
  while (bytes_ > most_bytes_ && recent_.size() > 1) {
    const auto oldest = entries_.find(recent_.back());
    is_full_ = true;
    bytes_ -= oldest->second.first->bytes();
    entries_.erase(oldest);
    recent_.pop_back();
  }
}

void KeptSights::begin() {
  const std::lock_guard lock(mutex_);
  for (auto entry = entries_.begin(); entry != entries_.end();)
    entry = entry->second.used_by == merge_ ? std::next(entry) : entries_.erase(entry);
  ++merge_;
}

std::shared_ptr<const WallSight> KeptSights::find(const Hash& content) {
  const std::lock_guard lock(mutex_);
  const auto found = entries_.find(content);
  if (found == entries_.end()) return nullptr;
  found->second.used_by = merge_;
  return found->second.sight;
}

void KeptSights::add(const Hash& content, std::shared_ptr<const WallSight> sight) {
  const std::lock_guard lock(mutex_);
  entries_[content] = {std::move(sight), merge_};
}

}  // namespace mapweave::fusion
