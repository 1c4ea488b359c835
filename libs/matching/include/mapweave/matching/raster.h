#pragma once
// A dense raster that grows in steps as things are written to it, and a sparse one to keep. Cells are named by whole
// numbers: cell (i, j) covers [i, i + 1) * resolution.

#include <algorithm>
#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

namespace mapweave::matching {

inline int cell_of(double metres, double inverse_resolution) {
  const double cells = metres * inverse_resolution;
  const int towards_zero = static_cast<int>(cells);
  return towards_zero - (cells < towards_zero ? 1 : 0);
}

template <class T>
class Raster {
 public:
  Raster() = default;
  // Covers cells first_x .. last_x and first_y .. last_y.
  Raster(int first_x, int first_y, int last_x, int last_y, T fill = T{})
      : x0_(first_x),
        y0_(first_y),
        width_(last_x - first_x + 1),
        height_(last_y - first_y + 1),
        fill_(fill),
        cells_(static_cast<std::size_t>(width_) * static_cast<std::size_t>(height_), fill) {}

  bool empty() const { return cells_.empty(); }
  int first_x() const { return x0_; }
  int first_y() const { return y0_; }
  int width() const { return width_; }
  int height() const { return height_; }
  T fill() const { return fill_; }
  std::size_t bytes() const { return cells_.capacity() * sizeof(T); }
  bool contains(int x, int y) const { return x >= x0_ && y >= y0_ && x < x0_ + width_ && y < y0_ + height_; }
  const T& at(int x, int y) const { return cells_[index(x, y)]; }
  T& at(int x, int y) { return cells_[index(x, y)]; }
  T get(int x, int y) const { return contains(x, y) ? at(x, y) : fill_; }  // the fill value outside
  // Cells from (x, y) rightwards; the caller keeps within the row.
  const T* row(int x, int y) const { return &cells_[index(x, y)]; }
  T* row(int x, int y) { return &cells_[index(x, y)]; }

  // Afterwards the raster contains these cells; grown sides get some more, so that growing is rare.
  void grow(int first_x, int first_y, int last_x, int last_y) {
    if (!cells_.empty() && contains(first_x, first_y) && contains(last_x, last_y)) return;
    constexpr int kStep = 64;
    int nx0 = first_x, ny0 = first_y, nx1 = last_x, ny1 = last_y;
    if (!cells_.empty()) {
      nx0 = std::min(first_x < x0_ ? first_x - kStep : x0_, x0_);
      ny0 = std::min(first_y < y0_ ? first_y - kStep : y0_, y0_);
      nx1 = std::max(last_x >= x0_ + width_ ? last_x + kStep : x0_ + width_ - 1, x0_ + width_ - 1);
      ny1 = std::max(last_y >= y0_ + height_ ? last_y + kStep : y0_ + height_ - 1, y0_ + height_ - 1);
    }
    Raster larger(nx0, ny0, nx1, ny1, fill_);
    for (int y = y0_; y < y0_ + height_; ++y) std::copy(row(x0_, y), row(x0_, y) + width_, larger.row(x0_, y));
    *this = std::move(larger);
  }

 private:
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y - y0_) * static_cast<std::size_t>(width_) + static_cast<std::size_t>(x - x0_);
  }
  int x0_ = 0, y0_ = 0, width_ = 0, height_ = 0;
  T fill_{};
  std::vector<T> cells_;
};

// The cells of a dense raster, without its blocks of nothing but the fill value: walls are few.
template <class T>
class SparseRaster {
 public:
  static constexpr int kBlock = 16;  // cells a side

  SparseRaster() = default;
  explicit SparseRaster(const Raster<T>& dense)
      : x0_(dense.first_x()),
        y0_(dense.first_y()),
        width_(dense.width()),
        height_(dense.height()),
        fill_(dense.fill()) {
    for (int y = 0; y < height_; y += kBlock)
      for (int x = 0; x < width_; x += kBlock) index_.push_back(kept(dense, x, y));
    blocks_.shrink_to_fit();
  }

  bool empty() const { return width_ == 0; }
  // Of the dense raster.
  int first_x() const { return x0_; }
  int first_y() const { return y0_; }
  int width() const { return width_; }
  int height() const { return height_; }
  std::size_t bytes() const { return blocks_.capacity() * sizeof(Block) + index_.capacity() * sizeof(std::int32_t); }
  T get(int x, int y) const {  // the fill value outside
    const int dx = x - x0_, dy = y - y0_;
    if (dx < 0 || dy < 0 || dx >= width_ || dy >= height_) return fill_;
    const std::int32_t block = index_[static_cast<std::size_t>(dy / kBlock * columns() + dx / kBlock)];
    return block < 0
               ? fill_
               : blocks_[static_cast<std::size_t>(block)][static_cast<std::size_t>(dy % kBlock * kBlock + dx % kBlock)];
  }
  // Calls visit(x, y, cells, count) for the rows of blocks that are kept: `count` cells from (x, y) rightwards.
  template <class Visit>
  void for_each_run(Visit&& visit) const {
    for (std::size_t k = 0; k < index_.size(); ++k) {
      if (index_[k] < 0) continue;
      const int dx = static_cast<int>(k) % columns() * kBlock, dy = static_cast<int>(k) / columns() * kBlock;
      const Block& block = blocks_[static_cast<std::size_t>(index_[k])];
      for (int row = 0; row < std::min(kBlock, height_ - dy); ++row)
        visit(x0_ + dx, y0_ + dy + row, block.data() + row * kBlock, std::min(kBlock, width_ - dx));
    }
  }
  Raster<T> dense() const {
    if (empty()) return {};
    Raster<T> all(x0_, y0_, x0_ + width_ - 1, y0_ + height_ - 1, fill_);
    for_each_run([&](int x, int y, const T* cells, int count) { std::copy(cells, cells + count, all.row(x, y)); });
    return all;
  }

 private:
  using Block = std::array<T, static_cast<std::size_t>(kBlock) * kBlock>;
  int columns() const { return (width_ + kBlock - 1) / kBlock; }
  // The block from there on, counted from the corner; -1: it holds nothing.
  std::int32_t kept(const Raster<T>& dense, int dx, int dy) {
    const int wide = std::min(kBlock, width_ - dx), high = std::min(kBlock, height_ - dy);
    const auto holds_nothing = [&](int row) {
      const T* cells = dense.row(x0_ + dx, y0_ + dy + row);
      return std::all_of(cells, cells + wide, [&](const T& cell) { return cell == fill_; });
    };
    int first = 0;
    while (first < high && holds_nothing(first)) ++first;
    if (first == high) return -1;
    Block& block = blocks_.emplace_back();
    block.fill(fill_);
    for (int row = first; row < high; ++row) {
      const T* cells = dense.row(x0_ + dx, y0_ + dy + row);
      std::copy(cells, cells + wide, block.begin() + row * kBlock);
    }
    return static_cast<std::int32_t>(blocks_.size() - 1);
  }

  int x0_ = 0, y0_ = 0, width_ = 0, height_ = 0;
  T fill_{};
  std::vector<std::int32_t> index_;  // of blocks; -1: nothing but the fill value
  std::vector<Block> blocks_;
};

}  // namespace mapweave::matching
