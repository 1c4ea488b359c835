#include <mapweave/exporters/hypothesis_sheet.h>

#include "drawing.h"

#include <mapweave/core/error.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>
#include <sstream>

namespace mapweave::exporters {
namespace {

constexpr int kSide_px = 720, kGap_px = 16;
constexpr double kCapital_px = 12.0;
constexpr double kClear_m = 0.2;  // nearer to each other, walls are one
// Blue, green, red; apart for any colour vision.
const cv::Scalar kOfA(178, 114, 0), kOfB(0, 159, 230), kOfBoth(25, 25, 25), kThrough(40, 40, 214), kFree(252, 252, 252),
    kUnknown(228, 228, 228);

class Layer {
 public:
  Layer(const OccupancyGrid& grid, const Pose2& a_from_grid, double scale = 1.0)
      : grid_(grid), a_from_grid_(a_from_grid), grid_from_a_(inverse(a_from_grid)), scale_(scale) {}

  template <class Visit>
  void for_each_wall(const Visit& visit) const {
    for (std::int32_t row = 0; row < grid_.rows; ++row)
      for (std::int32_t column = 0; column < grid_.columns; ++column)
        if (grid_.at(column, row) > OccupancyGrid::kUnknown) visit(in_a(column, row));
  }
  // Log odds at a point of a's frame.
  std::int16_t at(const cv::Point2d& p) const {
    const auto [column, row] = cell_at(p);
    return grid_.inside(column, row) ? grid_.at(column, row) : OccupancyGrid::kUnknown;
  }
  bool has_wall_near(const cv::Point2d& p, double radius_m) const {
    const auto [column, row] = cell_at(p);
    const auto reach = static_cast<std::int32_t>(std::ceil(radius_m / (scale_ * grid_.resolution_m)));
    for (std::int32_t j = row - reach; j <= row + reach; ++j)
      for (std::int32_t i = column - reach; i <= column + reach; ++i)
        if (grid_.inside(i, j) && grid_.at(i, j) > OccupancyGrid::kUnknown) return true;
    return false;
  }

 private:
  cv::Point2d in_a(std::int32_t column, std::int32_t row) const {
    const Pose2 p = compose(a_from_grid_, Pose2{scale_ * (grid_.origin_x_m + (column + 0.5) * grid_.resolution_m),
                                                scale_ * (grid_.origin_y_m + (row + 0.5) * grid_.resolution_m), 0.0});
    return {p.x, p.y};
  }
  std::pair<std::int32_t, std::int32_t> cell_at(const cv::Point2d& p) const {
    const Pose2 here = compose(grid_from_a_, Pose2{p.x, p.y, 0.0});
    const auto place = [&](double value, double origin) {
      return static_cast<std::int32_t>(std::clamp(std::floor((value - origin) / grid_.resolution_m), -1e6, 1e6));
    };
    return {place(here.x / scale_, grid_.origin_x_m), place(here.y / scale_, grid_.origin_y_m)};
  }
  const OccupancyGrid& grid_;
  Pose2 a_from_grid_, grid_from_a_;
  double scale_;
};

struct Bounds {
  double left = 1e300, low = 1e300, right = -1e300, high = -1e300;
  void take(const cv::Point2d& p) {
    left = std::min(left, p.x);
    right = std::max(right, p.x);
    low = std::min(low, p.y);
    high = std::max(high, p.y);
  }
  double side() const { return std::max({1.0, right - left, high - low}) * 1.06; }
};

void draw(cv::Mat image, const Layer& a, const Layer& b, const HypothesisPanel& panel, double side_m,
          const Bounds& bounds) {
  const double zoom = kSide_px / side_m;
  const cv::Point2d middle(0.5 * (bounds.left + bounds.right), 0.5 * (bounds.low + bounds.high));
  const auto pixel_of = [&](const cv::Point2d& p) {
    return cv::Point(static_cast<int>(std::floor(0.5 * kSide_px + (p.x - middle.x) * zoom)),
                     static_cast<int>(std::floor(0.5 * kSide_px - (p.y - middle.y) * zoom)));
  };
  for (int row = 0; row < kSide_px; ++row)
    for (int column = 0; column < kSide_px; ++column) {
      const cv::Point2d p(middle.x + (column + 0.5 - 0.5 * kSide_px) / zoom,
                          middle.y - (row + 0.5 - 0.5 * kSide_px) / zoom);
      const bool is_free = a.at(p) < OccupancyGrid::kUnknown || b.at(p) < OccupancyGrid::kUnknown;
      const cv::Scalar& colour = is_free ? kFree : kUnknown;
      image.at<cv::Vec3b>(row, column) =
          cv::Vec3b(static_cast<std::uint8_t>(colour[0]), static_cast<std::uint8_t>(colour[1]),
                    static_cast<std::uint8_t>(colour[2]));
    }
  const int dot = std::max(1, static_cast<int>(std::lround(0.05 * zoom)));
  const auto mark = [&](const cv::Point2d& p, const cv::Scalar& colour) {
    cv::rectangle(image, cv::Rect(pixel_of(p), cv::Size(dot, dot)) & cv::Rect(0, 0, kSide_px, kSide_px), colour,
                  cv::FILLED);
  };
  const auto is_ringed = [&](const cv::Point2d& p) {
    return std::any_of(panel.rings.begin(), panel.rings.end(), [&](const HypothesisPanel::Ring& ring) {
      return std::hypot(p.x - ring.x_m, p.y - ring.y_m) <= ring.radius_m;
    });
  };
  const auto walls = [&](const Layer& own, const Layer& other, const cv::Scalar& colour, bool contradicted) {
    own.for_each_wall([&](const cv::Point2d& p) {
      const bool is_of_both = other.has_wall_near(p, kClear_m);
      const bool is_through = !is_of_both && other.at(p) < OccupancyGrid::kUnknown && is_ringed(p);
      if (is_through == contradicted) mark(p, contradicted ? kThrough : is_of_both ? kOfBoth : colour);
    });
  };
  walls(a, b, kOfA, false);
  walls(b, a, kOfB, false);
  walls(a, b, kOfA, true);
  walls(b, a, kOfB, true);
  for (const HypothesisPanel::Ring& ring : panel.rings)
    cv::circle(image, pixel_of({ring.x_m, ring.y_m}), std::max(6, static_cast<int>(ring.radius_m * zoom)), kThrough, 1,
               cv::LINE_AA);
}

// 1, 2 or 5 times a power of ten, about a fifth of the side.
double scale_bar_m(double side_m) {
  const double about = 0.2 * side_m, power = std::pow(10.0, std::floor(std::log10(about)));
  return power * (about >= 5.0 * power ? 5.0 : about >= 2.0 * power ? 2.0 : 1.0);
}

// Lines of a caption as letters of the font, none wider than a panel where it has spaces to break at.
std::vector<std::string> wrapped(const std::vector<std::string>& caption) {
  std::vector<std::string> lines;
  for (const std::string& whole : caption) {
    std::istringstream words(ascii(whole));
    std::string line;
    for (std::string word; words >> word;) {
      const std::string longer = line.empty() ? word : line + " " + word;
      if (!line.empty() && Sheet::width_of(longer, kCapital_px) > kSide_px) {
        lines.push_back(line);
        line = "  " + word;
      } else {
        line = longer;
      }
    }
    lines.push_back(line);
  }
  return lines;
}

}  // namespace

std::string hypothesis_sheet_png(const OccupancyGrid& a, const OccupancyGrid& b,
                                 const std::vector<HypothesisPanel>& panels, const std::string& title,
                                 const std::string& a_name, const std::string& b_name) {
  MAPWEAVE_EXPECT(!panels.empty() && !a.empty() && !b.empty(), "a sheet of hypotheses has panels, and maps with cells");
  constexpr int kLine_px = 22, kTop_px = 64;
  const Layer of_a(a, {});
  std::vector<Bounds> bounds(panels.size());
  std::vector<std::vector<std::string>> captions(panels.size());
  double side_m = 1.0;
  std::size_t lines = 0;
  for (std::size_t i = 0; i < panels.size(); ++i) {
    const auto take = [&](const cv::Point2d& p) { bounds[i].take(p); };
    of_a.for_each_wall(take);
    Layer(b, panels[i].a_from_b, panels[i].scale).for_each_wall(take);
    if (bounds[i].left > bounds[i].right) bounds[i].take({0.0, 0.0});
    side_m = std::max(side_m, bounds[i].side());
    captions[i] = wrapped(panels[i].caption);
    lines = std::max(lines, captions[i].size());
  }
  const auto count = static_cast<int>(panels.size());
  const int title_px = 2 * kGap_px + Sheet::width_of(ascii(title), kCapital_px, 1.2);
  Sheet sheet(std::max(title_px, kGap_px + count * (kSide_px + kGap_px)),
              kTop_px + kSide_px + static_cast<int>(lines + 1) * kLine_px + kGap_px, kCapital_px);
  sheet.write(ascii(title), kGap_px, 26, kInk, 1.2);
  double left = kGap_px;
  const auto legend = [&](const std::string& text, const cv::Scalar& colour) {
    cv::rectangle(sheet.image(), cv::Rect(static_cast<int>(left), 40, 14, 14), colour, cv::FILLED);
    sheet.write(ascii(text), left + 20, 52, kInk);
    left += 44 + Sheet::width_of(ascii(text), kCapital_px);
  };
  legend("walls of " + a_name, kOfA);
  legend("walls of " + b_name, kOfB);
  legend("of both", kOfBoth);
  legend("seen through", kThrough);
  for (int i = 0; i < count; ++i) {
    const HypothesisPanel& panel = panels[static_cast<std::size_t>(i)];
    const std::vector<std::string>& caption = captions[static_cast<std::size_t>(i)];
    const int x = kGap_px + i * (kSide_px + kGap_px);
    draw(sheet.image()(cv::Rect(x, kTop_px, kSide_px, kSide_px)), of_a, Layer(b, panel.a_from_b, panel.scale), panel,
         side_m, bounds[static_cast<std::size_t>(i)]);
    const double bar_m = scale_bar_m(side_m), bar_px = bar_m * kSide_px / side_m;
    sheet.line({{x + 10.0, kTop_px + kSide_px - 12.0}, {x + 10.0 + bar_px, kTop_px + kSide_px - 12.0}}, kInk, 2);
    sheet.write(metres(bar_m, bar_m < 1.0 ? 1 : 0), x + 14.0 + bar_px, kTop_px + kSide_px - 8.0, kInk, 0.9, true);
    for (std::size_t line = 0; line < caption.size(); ++line)
      sheet.write(caption[line], x, kTop_px + kSide_px + static_cast<double>(line + 1) * kLine_px, kInk);
  }
  return encoded(sheet.image());
}

}  // namespace mapweave::exporters
