#include <mapweave/simulation/texture.h>

#include "normal_table.h"

#include <mapweave/core/error.h>

#include <algorithm>
#include <array>
#include <cmath>

namespace mapweave::simulation {
namespace {

int log2_of(int size) {
  int log2 = 0;
  while ((1 << log2) < size) ++log2;
  MAPWEAVE_EXPECT(size == 1 << log2 && log2 <= 13, "a texture's size is a power of two up to 8192");
  return log2;
}

}  // namespace

Texture::Texture(int width, int height, std::vector<std::uint8_t> texels)
    : width_(width), height_(height), texels_(std::move(texels)) {
  MAPWEAVE_EXPECT(texels_.size() == static_cast<std::size_t>(width) * static_cast<std::size_t>(height),
                  "a texture has its texels");
  int log2_width = log2_of(width), log2_height = log2_of(height);
  std::size_t first = 0;
  for (float scale = 256.0f;; scale *= 0.5f) {
    const std::size_t columns = std::size_t{1} << log2_width, rows = std::size_t{1} << log2_height;
    levels_.push_back({nullptr, static_cast<int>(columns) - 1, static_cast<int>(rows) - 1, log2_width, scale});
    if (log2_width == 0 || log2_height == 0) break;
    const std::size_t next = texels_.size();
    texels_.resize(next + columns * rows / 4);
    for (std::size_t row = 0; row < rows; row += 2) {
      const std::uint8_t* above = texels_.data() + first + row * columns;
      std::uint8_t* out = texels_.data() + next + row / 2 * (columns / 2);
      for (std::size_t column = 0; column < columns; column += 2) {
        const int sum = above[column] + above[column + 1] + above[columns + column] + above[columns + column + 1];
        out[column / 2] = static_cast<std::uint8_t>((sum + 2) / 4);
      }
    }
    first = next;
    --log2_width;
    --log2_height;
  }
  const std::uint8_t* texels_of_level = texels_.data();
  for (Level& level : levels_) {
    level.texels = texels_of_level;
    texels_of_level += static_cast<std::size_t>(level.mask_x + 1) * static_cast<std::size_t>(level.mask_y + 1);
  }
}

Canvas::Canvas(int width, int height, double texel_m)
    : width_(width),
      height_(height),
      texel_m_(texel_m),
      texels_(static_cast<std::size_t>(width) * static_cast<std::size_t>(height), 128) {}

// Adds to the texels inside. The limits may reach beyond the clip.
template <class Inside>
void Canvas::change(const Area& clip, const Limits& limits, int by, Inside&& inside) {
  const auto texel = [&](double metres) { return static_cast<int>(std::lround(metres / texel_m_)); };
  const int left = texel(std::max(limits.low_x, clip.left_m)),
            right = texel(std::min(limits.high_x, clip.left_m + clip.width_m));
  const int top = texel(std::max(limits.low_y, clip.top_m)),
            bottom = texel(std::min(limits.high_y, clip.top_m + clip.height_m));
  for (int row = top; row < bottom; ++row) {
    std::uint8_t* texels =
        texels_.data() + static_cast<std::size_t>(row & (height_ - 1)) * static_cast<std::size_t>(width_);
    for (int column = left; column < right; ++column) {
      if (!inside((column + 0.5) * texel_m_, (row + 0.5) * texel_m_)) continue;
      std::uint8_t& at = texels[column & (width_ - 1)];
      at = static_cast<std::uint8_t>(std::clamp(at + by, 0, 255));
    }
  }
}

void Canvas::fill(const Area& area, int value) {
  const auto texel = [&](double metres) { return static_cast<int>(std::lround(metres / texel_m_)); };
  const int left = texel(area.left_m), right = texel(area.left_m + area.width_m);
  for (int row = texel(area.top_m); row < texel(area.top_m + area.height_m); ++row) {
    std::uint8_t* texels =
        texels_.data() + static_cast<std::size_t>(row & (height_ - 1)) * static_cast<std::size_t>(width_);
    for (int column = left; column < right; ++column) texels[column & (width_ - 1)] = static_cast<std::uint8_t>(value);
  }
}

void Canvas::add_gradient(const Area& area, int from_left, int to_right) {
  constexpr int kSteps = 24;
  for (int i = 0; i < kSteps; ++i) {
    const double from = area.left_m + area.width_m * i / kSteps, to = area.left_m + area.width_m * (i + 1) / kSteps;
    change(area, {from, to, area.top_m, area.top_m + area.height_m},
           from_left + (to_right - from_left) * i / (kSteps - 1), [](double, double) { return true; });
  }
}

void Canvas::add_grain(const Area& area, double sigma, RandomNumbers& numbers) {
  // Whole levels, with the fraction left to chance; looked up by 12 bits, five of them from each number.
  static const NormalTable table;
  std::array<int, NormalTable::kSize> steps;
  RandomNumbers fractions(0x6772616973u);
  for (std::size_t i = 0; i < steps.size(); ++i)
    steps[i] = static_cast<int>(std::floor(static_cast<double>(table[i]) * sigma + fractions.uniform()));
  const int left = static_cast<int>(area.left_m / texel_m_),
            right = static_cast<int>((area.left_m + area.width_m) / texel_m_);
  const int top = static_cast<int>(area.top_m / texel_m_),
            bottom = static_cast<int>((area.top_m + area.height_m) / texel_m_);
  for (int row = top; row < bottom; ++row) {
    std::uint8_t* texels =
        texels_.data() + static_cast<std::size_t>(row & (height_ - 1)) * static_cast<std::size_t>(width_);
    for (int column = left; column < right;) {
      std::uint64_t bits = numbers.bits();
      for (const int end = std::min(right, column + 5); column < end; ++column, bits >>= 12) {
        std::uint8_t& at = texels[column & (width_ - 1)];
        at = static_cast<std::uint8_t>(std::clamp(at + steps[bits & 4095], 0, 255));
      }
    }
  }
}

void Canvas::add_shapes(const Area& area, double size_m, double share, int contrast, RandomNumbers& numbers) {
  const int count = static_cast<int>(std::ceil(share * area.width_m * area.height_m / (size_m * size_m)));
  for (int i = 0; i < count; ++i) {
    const double x = area.left_m + numbers.uniform() * area.width_m, y = area.top_m + numbers.uniform() * area.height_m;
    const double half_width = 0.5 * size_m * std::exp2(numbers.uniform(-1.0, 1.0)),
                 half_height = 0.5 * size_m * std::exp2(numbers.uniform(-1.0, 1.0));
    const int by = numbers.integer(contrast / 3, contrast) * (numbers.chance(0.5) ? 1 : -1);
    const int kind = numbers.integer(0, 3);
    const double angle = numbers.uniform(0.0, M_PI), c = std::cos(angle), s = std::sin(angle);
    const double reach = std::hypot(half_width, half_height);
    const auto draw = [&](double reach_x, double reach_y, auto&& inside) {
      change(area, {x - reach_x, x + reach_x, y - reach_y, y + reach_y}, by,
             [&](double at_x, double at_y) { return inside(at_x - x, at_y - y); });
    };
    if (kind == 0) {
      draw(half_width, half_height, [](double, double) { return true; });
    } else if (kind == 1) {
      draw(reach, reach, [&](double dx, double dy) {
        return std::abs(c * dx + s * dy) < half_width && std::abs(c * dy - s * dx) < half_height;
      });
    } else if (kind == 2) {
      draw(half_width, half_width, [&](double dx, double dy) { return dx * dx + dy * dy < half_width * half_width; });
    } else {
      draw(reach, reach, [&](double dx, double dy) {
        const double along = c * dx + s * dy, across = c * dy - s * dx;
        return std::abs(along) < half_width && std::abs(across) < half_height * (0.5 + 0.5 * along / half_width);
      });
    }
  }
}

void Canvas::add_lines(const Area& area, double step_m, double width_m, int by, bool is_upright) {
  const double length = is_upright ? area.width_m : area.height_m, first = is_upright ? area.left_m : area.top_m;
  for (double at = 0.0; at < length - 0.5 * texel_m_; at += step_m) {
    const auto anywhere = [](double, double) { return true; };
    if (is_upright) {
      change(area, {first + at, first + at + width_m, area.top_m, area.top_m + area.height_m}, by, anywhere);
    } else {
      change(area, {area.left_m, area.left_m + area.width_m, first + at, first + at + width_m}, by, anywhere);
    }
  }
}

}  // namespace mapweave::simulation
