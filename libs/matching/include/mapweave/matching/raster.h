#pragma once
// A dense raster that grows in steps as things are written to it. Cells are named by whole numbers: cell (i, j) covers
// [i, i + 1) * resolution.

#include <algorithm>
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

}  // namespace mapweave::matching
