#include <mapweave/exporters/grid_image.h>

#include "grey_image.h"
#include "number_text.h"
#include "robot_colours.h"

#include <mapweave/core/error.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace mapweave::exporters {
namespace {

constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
constexpr double kCapitalOfFontPx = 21.0;  // height of a capital letter at scale 1
const cv::Scalar kInk(40, 40, 40), kWall(25, 25, 25), kUnknown(228, 228, 228), kPaper(255, 255, 255);

std::string encoded(const cv::Mat& image) {
  std::vector<std::uint8_t> bytes;
  try {
    if (cv::imencode(".png", image, bytes, {cv::IMWRITE_PNG_COMPRESSION, 6})) return std::string(bytes.begin(), bytes.end());
  } catch (const cv::Exception& error) {
    throw Error(
        ErrorCode::kUnsupported,
        "a picture of " + std::to_string(image.cols) + " x " + std::to_string(image.rows) + " pixels cannot be encoded: " + error.err, {},
        "choose a larger cell");
  }
  throw Error(ErrorCode::kInternal, "PNG encoding failed");
}

// Cells [first_column, first_column + columns) x [first_row, ...) of the grid's lattice; may reach beyond the grid.
struct Window {
  std::int64_t first_column = 0, first_row = 0, columns = 0, rows = 0;
};

// First and last place that hold all but `kStray` of the known cells at either end: single rays that left by a window would shrink the
// building to a corner of its picture. The rim around the window gives back more than this takes from what is solid.
std::pair<std::int64_t, std::int64_t> without_strays(const std::vector<std::int64_t>& known) {
  constexpr double kStray = 0.005;
  std::int64_t all = 0;
  for (const std::int64_t count : known) all += count;
  const auto strays = static_cast<std::int64_t>(kStray * static_cast<double>(all));
  std::int64_t first = 0, last = static_cast<std::int64_t>(known.size()) - 1;
  for (std::int64_t passed = 0; first < last && passed + known[static_cast<std::size_t>(first)] <= strays; ++first)
    passed += known[static_cast<std::size_t>(first)];
  for (std::int64_t passed = 0; last > first && passed + known[static_cast<std::size_t>(last)] <= strays; --last)
    passed += known[static_cast<std::size_t>(last)];
  return {first, last};
}

// What is known and where robots were, with a rim.
Window window_of(const OccupancyGrid& grid, const std::vector<SessionTrajectory>& trajectories) {
  std::vector<std::int64_t> known_in_column(static_cast<std::size_t>(grid.columns)), known_in_row(static_cast<std::size_t>(grid.rows));
  for (std::int32_t row = 0; row < grid.rows; ++row)
    for (std::int32_t column = 0; column < grid.columns; ++column)
      if (grid.at(column, row) != OccupancyGrid::kUnknown)
        ++known_in_column[static_cast<std::size_t>(column)], ++known_in_row[static_cast<std::size_t>(row)];
  auto [left, right] = without_strays(known_in_column);
  auto [low, high] = without_strays(known_in_row);
  // A robot that went astray may widen the picture by half the map, no more.
  const auto cell_of = [&](double position_m, double origin_m, std::int32_t count) {
    return static_cast<std::int64_t>(std::clamp(std::floor((position_m - origin_m) / grid.resolution_m), -0.5 * count, 1.5 * count));
  };
  for (const auto& trajectory : trajectories)
    for (const auto& pose : trajectory.poses) {
      const std::int64_t column = cell_of(pose.map_from_robot.t.x(), grid.origin_x_m, grid.columns),
                         row = cell_of(pose.map_from_robot.t.y(), grid.origin_y_m, grid.rows);
      left = std::min(left, column), right = std::max(right, column);
      low = std::min(low, row), high = std::max(high, row);
    }
  const std::int64_t rim = 2 + std::max(right - left, high - low) / 50;
  return {left - rim, low - rim, right - left + 1 + 2 * rim, high - low + 1 + 2 * rim};
}

// How cells become pixels: each cell a square of `enlarged` pixels, or squares of `thinned` cells one pixel.
struct Zoom {
  std::int64_t enlarged = 1, thinned = 1;
  double pixels_per_cell() const { return static_cast<double>(enlarged) / static_cast<double>(thinned); }
};

Zoom zoom_of(const Window& window, const PictureOptions& options) {
  const std::int64_t longer = std::max(window.columns, window.rows);
  Zoom zoom;
  if (longer > options.most_side_px)
    zoom.thinned = (longer + options.most_side_px - 1) / options.most_side_px;
  else
    zoom.enlarged = std::clamp<std::int64_t>((options.common_side_px + longer / 2) / longer, 1, 40);
  return zoom;
}

cv::Mat drawn_cells(const OccupancyGrid& grid, const Window& window, const Zoom& zoom) {
  const int columns = static_cast<int>((window.columns + zoom.thinned - 1) / zoom.thinned),
            rows = static_cast<int>((window.rows + zoom.thinned - 1) / zoom.thinned);
  cv::Mat image(rows * static_cast<int>(zoom.enlarged), columns * static_cast<int>(zoom.enlarged), CV_8UC3, kUnknown);
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column) {
      bool wall = false, known = false;  // walls win, so that thinning never opens one
      for (std::int64_t y = 0; y < zoom.thinned && !wall; ++y)
        for (std::int64_t x = 0; x < zoom.thinned && !wall; ++x) {
          const std::int64_t c = window.first_column + column * zoom.thinned + x, r = window.first_row + row * zoom.thinned + y;
          if (c < 0 || r < 0 || c >= grid.columns || r >= grid.rows) continue;
          const std::int16_t log_odds = grid.at(static_cast<std::int32_t>(c), static_cast<std::int32_t>(r));
          wall = log_odds > 0;
          known = known || log_odds != OccupancyGrid::kUnknown;
        }
      if (!known) continue;
      const int size = static_cast<int>(zoom.enlarged);
      image(cv::Rect(column * size, (rows - 1 - row) * size, size, size)).setTo(wall ? kWall : kPaper);
    }
  return image;
}

// Paper to draw on, with one size of letters from which all else follows.
class Sheet {
 public:
  Sheet(int width_px, int height_px, double capital_px) : image_(height_px, width_px, CV_8UC3, kPaper), capital_px_(capital_px) {}
  cv::Mat& image() { return image_; }
  double capital_px() const { return capital_px_; }
  int line_px() const { return std::max(2, static_cast<int>(std::lround(capital_px_ / 9.0))); }

  // `left`, `base`: of the first letter's foot.
  void write(const std::string& text, double left, double base, const cv::Scalar& colour, double size = 1.0, bool halo = false) {
    const cv::Point at(static_cast<int>(std::lround(left)), static_cast<int>(std::lround(base)));
    const double scale = size * capital_px_ / kCapitalOfFontPx;
    if (halo) cv::putText(image_, text, at, kFont, scale, kPaper, stroke_px(size) + 2 * line_px(), cv::LINE_AA);
    cv::putText(image_, text, at, kFont, scale, colour, stroke_px(size), cv::LINE_AA);
  }
  static int width_of(const std::string& text, double capital_px, double size = 1.0) {
    int below = 0;
    return cv::getTextSize(text, kFont, size * capital_px / kCapitalOfFontPx,
                           std::max(1, static_cast<int>(std::lround(size * capital_px / 10.0))), &below)
        .width;
  }

  void mark_start(double x, double y, const cv::Scalar& colour) {
    const double radius = 0.42 * capital_px_;
    cv::circle(image_, fine(x, y), fine(radius), kPaper, cv::FILLED, cv::LINE_AA, kFineBits);
    cv::circle(image_, fine(x, y), fine(radius), colour, line_px() + 1, cv::LINE_AA, kFineBits);
  }
  void mark_end(double x, double y, const cv::Scalar& colour) {
    const double half = 0.42 * capital_px_;
    cv::rectangle(image_, fine(x - half, y - half), fine(x + half, y + half), colour, cv::FILLED, cv::LINE_AA, kFineBits);
    cv::rectangle(image_, fine(x - half, y - half), fine(x + half, y + half), kInk, 1, cv::LINE_AA, kFineBits);
  }
  void line(const std::vector<cv::Point2d>& points, const cv::Scalar& colour, int width_px) {
    std::vector<cv::Point> fine_points;
    for (const auto& point : points) fine_points.push_back(fine(point.x, point.y));
    cv::polylines(image_, fine_points, false, colour, width_px, cv::LINE_AA, kFineBits);
  }

 private:
  static constexpr int kFineBits = 4;  // sixteenths of a pixel
  static int fine(double px) { return static_cast<int>(std::lround(std::clamp(px, -1e6, 1e6) * (1 << kFineBits))); }
  static cv::Point fine(double x, double y) { return {fine(x), fine(y)}; }
  int stroke_px(double size) const { return std::max(1, static_cast<int>(std::lround(size * capital_px_ / 10.0))); }

  cv::Mat image_;
  double capital_px_;
};

// Only what the font has.
std::string ascii(const std::string& text) {
  std::string result;
  for (const char c : text) {
    if ((static_cast<unsigned char>(c) & 0xc0) == 0x80) continue;  // the rest of a letter beyond ASCII
    result += c >= ' ' && c <= '~' ? c : '?';
  }
  return result;
}

struct RobotWay {
  RobotId robot;
  cv::Scalar colour;
  std::vector<const SessionTrajectory*> sessions;
  double length_m = 0.0;
};

std::vector<RobotWay> ways_of(const std::vector<SessionTrajectory>& trajectories) {
  std::vector<const SessionTrajectory*> sorted;
  for (const auto& trajectory : trajectories)
    if (!trajectory.poses.empty()) sorted.push_back(&trajectory);
  std::stable_sort(sorted.begin(), sorted.end(), [](const auto* a, const auto* b) { return a->session < b->session; });
  std::vector<RobotWay> ways;
  for (const auto* trajectory : sorted) {
    if (ways.empty() || ways.back().robot != trajectory->session.client.robot) {
      const Colour colour = robot_colour(ways.size());
      ways.push_back({trajectory->session.client.robot, cv::Scalar(colour.blue, colour.green, colour.red), {}, 0.0});
    }
    ways.back().sessions.push_back(trajectory);
    for (std::size_t i = 1; i < trajectory->poses.size(); ++i)
      ways.back().length_m += (trajectory->poses[i].map_from_robot.t - trajectory->poses[i - 1].map_from_robot.t).head<2>().norm();
  }
  return ways;
}

std::string metres(double length_m, int decimals) {
  std::string text;
  append_fixed(text, length_m, decimals);
  return text + " m";
}

// The longest of 1, 2, 5, 10, ... metres (or parts of one) that is no longer.
double round_length(double most_m) {
  const double power = std::pow(10.0, std::floor(std::log10(most_m)));
  for (const double digit : {5.0, 2.0})
    if (digit * power <= most_m) return digit * power;
  return power;
}

struct LegendEntry {
  std::string text;
  const RobotWay* way;  // null: start and end explained
  double left_px, width_px;
  int line;
};

constexpr double kLegendLine = 2.0, kSwatch = 2.4, kLegendGap = 1.6, kTitle = 1.4;  // in capitals

std::vector<LegendEntry> legend_of(const std::vector<RobotWay>& ways, int width_px, double capital_px) {
  constexpr std::size_t kMost = 40;
  std::vector<LegendEntry> entries;
  double left = capital_px;
  int line = 0;
  const auto add = [&](const std::string& text, const RobotWay* way, double before_text) {
    const double width = before_text * capital_px + Sheet::width_of(text, capital_px);
    if (left > capital_px && left + width > width_px - capital_px) left = capital_px, ++line;
    entries.push_back({text, way, left, width, line});
    left += width + kLegendGap * capital_px;
  };
  for (std::size_t i = 0; i < std::min(ways.size(), kMost); ++i)
    add(ways[i].robot.str() + " (" + metres(ways[i].length_m, ways[i].length_m < 10.0 ? 1 : 0) + ")", &ways[i], kSwatch + 0.5);
  if (ways.size() > kMost) add("and " + std::to_string(ways.size() - kMost) + " more", nullptr, 0.0);
  if (!ways.empty()) {
    add("start", nullptr, 1.5);
    add("end", nullptr, 1.5);
  }
  return entries;
}

void draw_legend(Sheet& sheet, const std::vector<LegendEntry>& legend, double top) {
  const double capital = sheet.capital_px();
  for (const auto& entry : legend) {
    const double base = top + (entry.line * kLegendLine + 1.0) * capital, middle = base - 0.5 * capital;
    const double text_left = entry.left_px + entry.width_px - Sheet::width_of(entry.text, capital);
    if (entry.way != nullptr)
      sheet.line({{entry.left_px, middle}, {entry.left_px + kSwatch * capital, middle}}, entry.way->colour,
                 std::max(3, static_cast<int>(capital / 3.0)));
    if (entry.text == "start" && entry.way == nullptr) sheet.mark_start(entry.left_px + 0.5 * capital, middle, kInk);
    if (entry.text == "end" && entry.way == nullptr) sheet.mark_end(entry.left_px + 0.5 * capital, middle, kInk);
    sheet.write(entry.text, text_left, base, kInk);
  }
}

// Names beside the starts, where there is room for them.
void draw_names(Sheet& sheet, const std::vector<RobotWay>& ways, const std::vector<cv::Point2d>& starts, const cv::Rect& map) {
  constexpr double kSize = 0.85;
  const double height = kSize * sheet.capital_px(), away = 0.9 * sheet.capital_px();
  std::vector<cv::Rect2d> taken;
  for (const auto& start : starts) taken.emplace_back(start.x - 0.5 * away, start.y - 0.5 * away, away, away);
  for (std::size_t i = 0; i < ways.size(); ++i) {
    const double width = Sheet::width_of(ways[i].robot.str(), sheet.capital_px(), kSize);
    const cv::Point2d& start = starts[i];
    for (const auto& [left, base] :
         {std::pair(start.x + away, start.y + 0.5 * height), std::pair(start.x - away - width, start.y + 0.5 * height),
          std::pair(start.x - 0.5 * width, start.y - away), std::pair(start.x - 0.5 * width, start.y + away + height)}) {
      const cv::Rect2d box(left, base - height, width, height);
      const bool inside =
          box.x >= map.x && box.y >= map.y && box.x + box.width <= map.x + map.width && box.y + box.height <= map.y + map.height;
      if (!inside || std::any_of(taken.begin(), taken.end(), [&](const cv::Rect2d& other) { return (other & box).area() > 0.0; })) continue;
      sheet.write(ways[i].robot.str(), left, base, ways[i].colour, kSize, true);
      taken.push_back(box);
      break;
    }
  }
}

}  // namespace

std::string grid_png(const OccupancyGrid& grid) {
  GreyImage image = grey_image(grid);
  return encoded(cv::Mat(image.rows, image.columns, CV_8U, image.shades.data()));
}

std::string map_picture_png(const OccupancyGrid& grid, const std::vector<SessionTrajectory>& trajectories, const PictureOptions& options) {
  MAPWEAVE_EXPECT(!grid.empty(), "a grid without cells has no picture");
  const std::vector<RobotWay> ways = ways_of(trajectories);
  const Window window = window_of(grid, trajectories);
  const Zoom zoom = zoom_of(window, options);
  const cv::Mat cells = drawn_cells(grid, window, zoom);

  // Title, legend, map, scale: one below the other.
  const double capital = std::clamp(std::max(cells.cols, options.least_width_px) / 75.0, 12.0, 60.0);
  const int width = std::max(options.least_width_px, cells.cols + 2 * static_cast<int>(capital));
  const auto legend = legend_of(ways, width, capital);
  const double legend_top = options.title.empty() ? capital : (kTitle + 2.2) * capital;
  const double map_top = legend.empty() ? legend_top : legend_top + (legend.back().line + 1) * kLegendLine * capital;
  const cv::Rect map((width - cells.cols) / 2, static_cast<int>(map_top), cells.cols, cells.rows);
  Sheet sheet(width, map.y + map.height + static_cast<int>(3.6 * capital), capital);

  if (!options.title.empty()) {
    const std::string title = ascii(options.title);
    const double size = std::min(kTitle, kTitle * (width - 2.0 * capital) / Sheet::width_of(title, capital, kTitle));
    sheet.write(title, capital, (1.0 + kTitle) * capital, kInk, size);
  }
  draw_legend(sheet, legend, legend_top);
  cells.copyTo(sheet.image()(map));

  const double pixels_per_m = zoom.pixels_per_cell() / grid.resolution_m;
  const double left_m = grid.origin_x_m + static_cast<double>(window.first_column) * grid.resolution_m,
               low_m = grid.origin_y_m + static_cast<double>(window.first_row) * grid.resolution_m;
  const auto in_picture = [&](const StampedPose& pose) {
    return cv::Point2d(map.x + (pose.map_from_robot.t.x() - left_m) * pixels_per_m - 0.5,
                       map.y + map.height - (pose.map_from_robot.t.y() - low_m) * pixels_per_m - 0.5);
  };
  std::vector<cv::Point2d> starts;
  for (const auto& way : ways) {
    for (const auto* session : way.sessions) {
      std::vector<cv::Point2d> line;
      for (const auto& pose : session->poses) {
        const cv::Point2d point = in_picture(pose);
        if (line.empty() || std::hypot(point.x - line.back().x, point.y - line.back().y) >= 0.5) line.push_back(point);
      }
      sheet.line(line, way.colour, sheet.line_px());
    }
    starts.push_back(in_picture(way.sessions.front()->poses.front()));
  }
  for (const auto& way : ways)
    for (const auto* session : way.sessions) {
      const cv::Point2d start = in_picture(session->poses.front()), end = in_picture(session->poses.back());
      sheet.mark_end(end.x, end.y, way.colour);
      sheet.mark_start(start.x, start.y, way.colour);
    }
  if (ways.size() > 1) draw_names(sheet, ways, starts, map);
  cv::rectangle(sheet.image(), map, cv::Scalar(170, 170, 170), 1);

  const double bar_m = round_length(0.25 * cells.cols / pixels_per_m), bar_px = bar_m * pixels_per_m;
  const double bar_y = map.y + map.height + 1.9 * capital, bar_left = map.x;
  sheet.line({{bar_left, bar_y - 0.5 * capital}, {bar_left, bar_y}, {bar_left + bar_px, bar_y}, {bar_left + bar_px, bar_y - 0.5 * capital}},
             kInk, sheet.line_px());
  sheet.write(metres(bar_m, bar_m < 0.1 ? 2 : bar_m < 1.0 ? 1 : 0), bar_left + bar_px + 0.6 * capital, bar_y, kInk);
  std::string size = metres(static_cast<double>(window.columns) * grid.resolution_m, 1);
  size = size.substr(0, size.size() - 2) + " x " + metres(static_cast<double>(window.rows) * grid.resolution_m, 1) + ", cell ";
  append_shortest(size, grid.resolution_m);
  size += " m";
  // Beside the bar where there is room.
  const double size_left = width - capital - Sheet::width_of(size, capital, 0.85);
  if (size_left > bar_left + bar_px + 6.0 * capital) sheet.write(size, size_left, bar_y, kInk, 0.85);
  return encoded(sheet.image());
}

}  // namespace mapweave::exporters
