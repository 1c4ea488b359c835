#include "framed_map.h"

#include <mapweave/exporters/robot_colours.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace mapweave::exporters {
namespace {

struct DrawnTrajectory {
  RobotId robot;
  cv::Scalar colour;
  std::vector<const SessionTrajectory*> sessions;
  double length_m = 0.0;
};

std::vector<DrawnTrajectory> trajectories_of(const std::vector<SessionTrajectory>& trajectories) {
  std::vector<const SessionTrajectory*> sorted;
  for (const auto& trajectory : trajectories)
    if (!trajectory.poses.empty()) sorted.push_back(&trajectory);
  std::stable_sort(sorted.begin(), sorted.end(), [](const auto* a, const auto* b) { return a->session < b->session; });
  std::vector<DrawnTrajectory> robot_trajectories;
  for (const auto* trajectory : sorted) {
    if (robot_trajectories.empty() || robot_trajectories.back().robot != trajectory->session.client.robot) {
      const RobotColour colour = robot_colour(robot_trajectories.size());
      robot_trajectories.push_back(
          {trajectory->session.client.robot, cv::Scalar(colour.blue, colour.green, colour.red), {}, 0.0});
    }
    robot_trajectories.back().sessions.push_back(trajectory);
    for (std::size_t i = 1; i < trajectory->poses.size(); ++i)
      robot_trajectories.back().length_m +=
          (trajectory->poses[i].map_from_robot.t - trajectory->poses[i - 1].map_from_robot.t).head<2>().norm();
  }
  return robot_trajectories;
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
  const DrawnTrajectory* trajectory;  // null: start and end explained
  double left_px, width_px;
  int line;
};

constexpr double kLegendLine = 2.0, kSwatch = 2.4, kLegendGap = 1.6, kTitle = 1.4;  // in capitals

std::vector<LegendEntry> legend_of(const std::vector<DrawnTrajectory>& robot_trajectories, int width_px,
                                   double capital_px) {
  constexpr std::size_t kMost = 40;
  std::vector<LegendEntry> entries;
  double left = capital_px;
  int line = 0;
  const auto add = [&](const std::string& text, const DrawnTrajectory* trajectory, double before_text) {
    const double width = before_text * capital_px + Sheet::width_of(text, capital_px);
    if (left > capital_px && left + width > width_px - capital_px) {
      left = capital_px;
      ++line;
    }
    entries.push_back({text, trajectory, left, width, line});
    left += width + kLegendGap * capital_px;
  };
  for (std::size_t i = 0; i < std::min(robot_trajectories.size(), kMost); ++i) {
    const DrawnTrajectory& one = robot_trajectories[i];
    add(one.robot.str() + " (" + metres(one.length_m, one.length_m < 10.0 ? 1 : 0) + ")", &one, kSwatch + 0.5);
  }
  if (robot_trajectories.size() > kMost)
    add("and " + std::to_string(robot_trajectories.size() - kMost) + " more", nullptr, 0.0);
  if (!robot_trajectories.empty()) {
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
    if (entry.trajectory != nullptr)
      sheet.line({{entry.left_px, middle}, {entry.left_px + kSwatch * capital, middle}}, entry.trajectory->colour,
                 std::max(3, static_cast<int>(capital / 3.0)));
    if (entry.text == "start" && entry.trajectory == nullptr)
      sheet.mark_start(entry.left_px + 0.5 * capital, middle, kInk);
    if (entry.text == "end" && entry.trajectory == nullptr) sheet.mark_end(entry.left_px + 0.5 * capital, middle, kInk);
    sheet.write(entry.text, text_left, base, kInk);
  }
}

// Names beside the starts, where there is room for them.
void draw_names(Sheet& sheet, const std::vector<DrawnTrajectory>& robot_trajectories,
                const std::vector<cv::Point2d>& starts, const cv::Rect& map) {
  constexpr double kSize = 0.85;
  const double height = kSize * sheet.capital_px(), away = 0.9 * sheet.capital_px();
  std::vector<cv::Rect2d> taken;
  for (const auto& start : starts) taken.emplace_back(start.x - 0.5 * away, start.y - 0.5 * away, away, away);
  for (std::size_t i = 0; i < robot_trajectories.size(); ++i) {
    const double width = Sheet::width_of(robot_trajectories[i].robot.str(), sheet.capital_px(), kSize);
    const cv::Point2d& start = starts[i];
    for (const auto& [left, base] :
         {std::pair(start.x + away, start.y + 0.5 * height), std::pair(start.x - away - width, start.y + 0.5 * height),
          std::pair(start.x - 0.5 * width, start.y - away),
          std::pair(start.x - 0.5 * width, start.y + away + height)}) {
      const cv::Rect2d box(left, base - height, width, height);
      const bool inside = box.x >= map.x && box.y >= map.y && box.x + box.width <= map.x + map.width &&
                          box.y + box.height <= map.y + map.height;
      if (!inside ||
          std::any_of(taken.begin(), taken.end(), [&](const cv::Rect2d& other) { return (other & box).area() > 0.0; }))
        continue;
      sheet.write(robot_trajectories[i].robot.str(), left, base, robot_trajectories[i].colour, kSize, true);
      taken.push_back(box);
      break;
    }
  }
}

}  // namespace

std::string framed_map_png(const MapRaster& raster, const std::vector<SessionTrajectory>& trajectories,
                           const PictureOptions& options) {
  const std::vector<DrawnTrajectory> robot_trajectories = trajectories_of(trajectories);
  // Title, legend, map, scale: one below the other.
  const double capital = std::clamp(std::max(raster.pixels.cols, options.least_width_px) / 75.0, 12.0, 60.0);
  const int width = std::max(options.least_width_px, raster.pixels.cols + 2 * static_cast<int>(capital));
  const auto legend = legend_of(robot_trajectories, width, capital);
  const double legend_top = options.title.empty() ? capital : (kTitle + 2.2) * capital;
  const double map_top = legend.empty() ? legend_top : legend_top + (legend.back().line + 1) * kLegendLine * capital;
  const cv::Rect map((width - raster.pixels.cols) / 2, static_cast<int>(map_top), raster.pixels.cols,
                     raster.pixels.rows);
  Sheet sheet(width, map.y + map.height + static_cast<int>(3.6 * capital), capital);

  if (!options.title.empty()) {
    const std::string title = ascii(options.title);
    const double size = std::min(kTitle, kTitle * (width - 2.0 * capital) / Sheet::width_of(title, capital, kTitle));
    sheet.write(title, capital, (1.0 + kTitle) * capital, kInk, size);
  }
  draw_legend(sheet, legend, legend_top);
  raster.pixels.copyTo(sheet.image()(map));

  const auto in_picture = [&](const StampedPose& pose) {
    return cv::Point2d(map.x + (pose.map_from_robot.t.x() - raster.left_m) * raster.pixels_per_m - 0.5,
                       map.y + map.height - (pose.map_from_robot.t.y() - raster.low_m) * raster.pixels_per_m - 0.5);
  };
  std::vector<cv::Point2d> starts;
  for (const auto& trajectory : robot_trajectories) {
    for (const auto* session : trajectory.sessions) {
      std::vector<cv::Point2d> line;
      for (const auto& pose : session->poses) {
        const cv::Point2d point = in_picture(pose);
        if (line.empty() || std::hypot(point.x - line.back().x, point.y - line.back().y) >= 0.5) line.push_back(point);
      }
      sheet.line(line, trajectory.colour, sheet.line_px());
    }
    starts.push_back(in_picture(trajectory.sessions.front()->poses.front()));
  }
  for (const auto& trajectory : robot_trajectories)
    for (const auto* session : trajectory.sessions) {
      const cv::Point2d start = in_picture(session->poses.front()), end = in_picture(session->poses.back());
      sheet.mark_end(end.x, end.y, trajectory.colour);
      sheet.mark_start(start.x, start.y, trajectory.colour);
    }
  if (robot_trajectories.size() > 1) draw_names(sheet, robot_trajectories, starts, map);
  cv::rectangle(sheet.image(), map, cv::Scalar(170, 170, 170), 1);

  const double bar_m = round_length(0.25 * raster.pixels.cols / raster.pixels_per_m),
               bar_px = bar_m * raster.pixels_per_m;
  const double bar_y = map.y + map.height + 1.9 * capital, bar_left = map.x;
  sheet.line({{bar_left, bar_y - 0.5 * capital},
              {bar_left, bar_y},
              {bar_left + bar_px, bar_y},
              {bar_left + bar_px, bar_y - 0.5 * capital}},
             kInk, sheet.line_px());
  sheet.write(metres(bar_m, bar_m < 0.1 ? 2 : bar_m < 1.0 ? 1 : 0), bar_left + bar_px + 0.6 * capital, bar_y, kInk);
  // Beside the bar where there is room.
  const double size_left = width - capital - Sheet::width_of(raster.size, capital, 0.85);
  if (size_left > bar_left + bar_px + 6.0 * capital) sheet.write(raster.size, size_left, bar_y, kInk, 0.85);
  return encoded(sheet.image());
}

}  // namespace mapweave::exporters
