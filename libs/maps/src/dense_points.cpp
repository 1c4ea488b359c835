#include "dense_points.h"

#include <mapweave/core/error.h>

#include <algorithm>
#include <array>

namespace mapweave {
namespace {

constexpr std::size_t kFewest = 16;  // of fewer points the head takes more than their bits save
// Bits, as the header describes: a run of ones as long as the first is dearer than the whole of a number, of 16 bits;
// the head's numbers go up to 15 and 16.
constexpr int kLongestRun = 24, kWhole = 16, kShiftBits = 4, kWidthBits = 5;

class BitWriter {
 public:
  void put(std::uint32_t value, int width) {
    held_ |= std::uint64_t{value} << count_;
    count_ += width;
    for (; count_ >= 8; count_ -= 8, held_ >>= 8) bytes_.push_back(static_cast<char>(held_ & 0xff));
  }
  std::string finish() {
    if (count_ > 0) bytes_.push_back(static_cast<char>(held_ & 0xff));
    return std::move(bytes_);
  }

 private:
  std::string bytes_;
  std::uint64_t held_ = 0;
  int count_ = 0;
};

// Reads zeros past the end.
class BitReader {
 public:
  explicit BitReader(std::string_view bytes) : bytes_(bytes) {}
  std::uint32_t take(int width) {
    while (count_ < width) {
      held_ |= std::uint64_t{next_ < bytes_.size() ? static_cast<std::uint8_t>(bytes_[next_]) : std::uint8_t{0}}
               << count_;
      ++next_;
      count_ += 8;
    }
    const auto value = static_cast<std::uint32_t>(held_ & ((std::uint64_t{1} << width) - 1));
    held_ >>= width;
    count_ -= width;
    return value;
  }
  bool is_finished() const { return next_ == bytes_.size() && count_ < 8 && held_ == 0; }

 private:
  std::string_view bytes_;
  std::size_t next_ = 0;
  std::uint64_t held_ = 0;
  int count_ = 0;
};

struct Column {
  int shift = 0, width = 0;
};

int bits_of(std::uint32_t value) {
  int bits = 0;
  for (; value > 0; value >>= 1) ++bits;
  return bits;
}

template <class Field>
Column column_of(const std::vector<KeyframePoint>& points, Field KeyframePoint::*field) {
  std::uint32_t all = 0;
  for (const KeyframePoint& point : points) all |= point.*field;
  Column column;
  while (all > 0 && (all >> column.shift & 1) == 0 && column.shift < 15) ++column.shift;
  column.width = bits_of(all >> column.shift);
  return column;
}

// Low bits of what is added to v that make the shortest stream.
int rice_bits(const std::vector<KeyframePoint>& points, int shift) {
  std::pair<std::uint64_t, int> best{~std::uint64_t{0}, 0};
  for (int low = 0; low <= kWhole; ++low) {
    std::uint64_t sum = 0;
    std::uint32_t before = 0;
    for (const KeyframePoint& point : points) {
      const std::uint32_t v = std::uint32_t{point.v} >> shift, high = (v - before) >> low;
      sum += high < kLongestRun ? high + 1 + static_cast<std::uint32_t>(low) : kLongestRun + kWhole;
      before = v;
    }
    best = std::min(best, {sum, low});
  }
  return best.second;
}

}  // namespace

bool can_be_dense(const std::vector<KeyframePoint>& points) {
  return points.size() >= kFewest &&
         std::is_sorted(points.begin(), points.end(),
                        [](const KeyframePoint& a, const KeyframePoint& b) { return a.v < b.v; });
}

std::string dense(const std::vector<KeyframePoint>& points) {
  MAPWEAVE_EXPECT(can_be_dense(points), "v rises");
  const Column u = column_of(points, &KeyframePoint::u), depth = column_of(points, &KeyframePoint::inverse_depth),
               level = column_of(points, &KeyframePoint::level), angle = column_of(points, &KeyframePoint::angle);
  Column v = column_of(points, &KeyframePoint::v);
  v.width = rice_bits(points, v.shift);
  BitWriter writer;
  for (const Column& column : {u, v, depth, level, angle}) {
    writer.put(static_cast<std::uint32_t>(column.shift), kShiftBits);
    writer.put(static_cast<std::uint32_t>(column.width), kWidthBits);
  }
  std::uint32_t before = 0;
  for (const KeyframePoint& point : points) {
    const std::uint32_t now = std::uint32_t{point.v} >> v.shift, added = now - before, high = added >> v.width;
    before = now;
    if (high < kLongestRun) {
      writer.put((std::uint32_t{1} << high) - 1, static_cast<int>(high) + 1);
      writer.put(added & ((std::uint32_t{1} << v.width) - 1), v.width);
    } else {
      writer.put((std::uint32_t{1} << kLongestRun) - 1, kLongestRun);
      writer.put(added, kWhole);
    }
    writer.put(std::uint32_t{point.u} >> u.shift, u.width);
    writer.put(std::uint32_t{point.inverse_depth} >> depth.shift, depth.width);
    writer.put(std::uint32_t{point.level} >> level.shift, level.width);
    writer.put(std::uint32_t{point.angle} >> angle.shift, angle.width);
  }
  return writer.finish();
}

std::optional<std::vector<KeyframePoint>> from_dense(std::string_view bytes, std::size_t count) {
  BitReader reader(bytes);
  std::array<Column, 5> columns;
  for (Column& column : columns) {
    column.shift = static_cast<int>(reader.take(kShiftBits));
    column.width = static_cast<int>(reader.take(kWidthBits));
    if (column.width > kWhole) return std::nullopt;
  }
  const auto& [u, v, depth, level, angle] = columns;
  std::vector<KeyframePoint> points(count);
  bool fits = true;
  const auto take = [&](auto& field, const Column& column) {
    const std::uint32_t value = reader.take(column.width) << column.shift;
    field = static_cast<std::decay_t<decltype(field)>>(value);
    fits = fits && value == field;
  };
  std::uint32_t now = 0;
  for (KeyframePoint& point : points) {
    std::uint32_t high = 0;
    while (high < kLongestRun && reader.take(1) == 1) ++high;
    now += high < kLongestRun ? (high << v.width) + reader.take(v.width) : reader.take(kWhole);
    if (now > std::uint32_t{0xffff} >> v.shift) return std::nullopt;
    point.v = static_cast<std::uint16_t>(now << v.shift);
    take(point.u, u);
    take(point.inverse_depth, depth);
    take(point.level, level);
    take(point.angle, angle);
    if (!fits) return std::nullopt;
  }
  if (!reader.is_finished()) return std::nullopt;
  return points;
}

}  // namespace mapweave
