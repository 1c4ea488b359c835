#include <mapweave/exporters/trajectory_plot.h>

#include "drawing.h"
#include "number_text.h"

#include <mapweave/core/error.h>
#include <mapweave/exporters/robot_colours.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace mapweave::exporters {
namespace {

constexpr int kWidth_px = 1600, kMapHeight_px = 760, kTimeHeight_px = 420, kTop_px = 60;
constexpr double kCapital_px = 13.0;
const cv::Scalar kGrid(225, 225, 225), kReference(150, 150, 150);  // blue, green, red

// From dark blue by grey to yellow: its lightness rises evenly (after cividis, Nunez et al. 2018).
cv::Scalar error_colour(double share) {
  constexpr std::array<std::array<double, 3>, 5> kStops = {
      {{0, 34, 78}, {53, 69, 108}, {124, 123, 120}, {187, 174, 111}, {254, 232, 56}}};  // red, green, blue
  const double at = std::clamp(share, 0.0, 1.0) * (kStops.size() - 1);
  const std::size_t i = std::min(static_cast<std::size_t>(at), kStops.size() - 2);
  const double part = at - static_cast<double>(i);
  const auto mixed = [&](std::size_t c) { return (1.0 - part) * kStops[i][c] + part * kStops[i + 1][c]; };
  return {mixed(2), mixed(1), mixed(0)};
}

cv::Scalar track_colour(std::size_t place) {
  const RobotColour colour = robot_colour(place);
  return {static_cast<double>(colour.blue), static_cast<double>(colour.green), static_cast<double>(colour.red)};
}

// 1, 2 or 5 times a power of ten, so that about `count` of them make the span.
double tick_of(double span, int count) {
  const double rough = std::max(span, 1e-12) / count, unit = std::pow(10.0, std::floor(std::log10(rough)));
  for (const double step : {1.0, 2.0, 5.0})
    if (rough <= step * unit) return step * unit;
  return 10.0 * unit;
}

std::string number_text(double value, double tick) {
  std::string text;
  append_fixed(text, value, std::clamp(static_cast<int>(-std::floor(std::log10(tick) + 1e-9)), 0, 6));
  return text;
}

// A rectangle of the sheet with axes. y is up.
struct Axes {
  cv::Rect inside;
  double left = 0.0, right = 1.0, bottom = 0.0, top = 1.0;  // what its borders stand for
  cv::Point2d at(double x, double y) const {
    return {inside.x + (x - left) / (right - left) * inside.width,
            inside.y + inside.height - (y - bottom) / (top - bottom) * inside.height};
  }
};

void draw_axes(Sheet& sheet, const Axes& axes, const std::string& title, const std::string& along) {
  const double tick_x = tick_of(axes.right - axes.left, 7), tick_y = tick_of(axes.top - axes.bottom, 6);
  for (double x = std::ceil(axes.left / tick_x) * tick_x; x <= axes.right; x += tick_x) {
    sheet.line({axes.at(x, axes.bottom), axes.at(x, axes.top)}, kGrid, 1);
    const std::string text = number_text(x, tick_x);
    sheet.write(text, axes.at(x, 0).x - 0.5 * Sheet::width_of(text, kCapital_px, 0.8),
                axes.inside.y + axes.inside.height + 1.8 * kCapital_px, kInk, 0.8);
  }
  for (double y = std::ceil(axes.bottom / tick_y) * tick_y; y <= axes.top; y += tick_y) {
    sheet.line({axes.at(axes.left, y), axes.at(axes.right, y)}, kGrid, 1);
    const std::string text = number_text(y, tick_y);
    sheet.write(text, axes.inside.x - Sheet::width_of(text, kCapital_px, 0.8) - 8.0,
                axes.at(0, y).y + 0.4 * kCapital_px, kInk, 0.8);
  }
  cv::rectangle(sheet.image(), axes.inside, kInk, 1);
  sheet.write(title, axes.inside.x, axes.inside.y - 0.8 * kCapital_px, kInk);
  sheet.write(along, axes.inside.x + axes.inside.width - Sheet::width_of(along, kCapital_px, 0.8),
              axes.inside.y + axes.inside.height + 3.6 * kCapital_px, kInk, 0.8);
}

double error_m(const PlottedPose& pose) { return (pose.estimate - pose.reference).norm(); }

// The two axes in which the references extend most, in order.
std::array<int, 2> plane_of(const std::vector<PlottedTrack>& tracks) {
  Eigen::Vector3d least = tracks.front().poses.front().reference, most = least;
  for (const PlottedTrack& track : tracks)
    for (const PlottedPose& pose : track.poses) {
      least = least.cwiseMin(pose.reference);
      most = most.cwiseMax(pose.reference);
    }
  int smallest = 2;  // of two that are alike, the later axis: the robots' floor is x and y
  for (const int axis : {1, 0})
    if ((most - least)[axis] < 0.999 * (most - least)[smallest]) smallest = axis;
  return smallest == 2 ? std::array<int, 2>{0, 1} : smallest == 1 ? std::array<int, 2>{0, 2} : std::array<int, 2>{1, 2};
}

// Of all tracks, metres of both axes as long.
Axes map_axes(const std::vector<PlottedTrack>& tracks, const std::array<int, 2>& plane, const cv::Rect& inside) {
  constexpr double kMargin = 1.08;
  double low[2] = {INFINITY, INFINITY}, high[2] = {-INFINITY, -INFINITY};
  for (const PlottedTrack& track : tracks)
    for (const PlottedPose& pose : track.poses)
      for (const Eigen::Vector3d& point : {pose.estimate, pose.reference})
        for (int i = 0; i < 2; ++i) {
          low[i] = std::min(low[i], point[plane[static_cast<std::size_t>(i)]]);
          high[i] = std::max(high[i], point[plane[static_cast<std::size_t>(i)]]);
        }
  const double metres_per_px =
      kMargin * std::max({(high[0] - low[0]) / inside.width, (high[1] - low[1]) / inside.height, 1e-6});
  const double half_x = 0.5 * metres_per_px * inside.width, half_y = 0.5 * metres_per_px * inside.height;
  const double x = 0.5 * (low[0] + high[0]), y = 0.5 * (low[1] + high[1]);
  return {inside, x - half_x, x + half_x, y - half_y, y + half_y};
}

class Plot {
 public:
  Plot(const std::vector<PlottedTrack>& tracks, const std::string& title)
      : tracks_(tracks),
        plane_(plane_of(tracks)),
        sheet_(kWidth_px, kTop_px + kMapHeight_px + kTimeHeight_px, kCapital_px) {
    sheet_.write(ascii(title), 20, 34, kInk, 1.2);
    first_s_ = last_s_ = tracks.front().poses.front().stamp_s;
    for (const PlottedTrack& track : tracks)
      for (const PlottedPose& pose : track.poses) {
        first_s_ = std::min(first_s_, pose.stamp_s);
        last_s_ = std::max(last_s_, pose.stamp_s);
        worst_m_ = std::max(worst_m_, error_m(pose));
      }
  }

  std::string png() {
    constexpr int kLeft = 80, kGap = 110, kHeight = kMapHeight_px - 110;
    constexpr int kSide = (kWidth_px - 2 * kLeft - kGap - 60) / 2;
    draw_overlay({kLeft, kTop_px + 40, kSide, kHeight});
    draw_errors({kLeft + kSide + kGap, kTop_px + 40, kSide, kHeight});
    draw_times({kLeft, kTop_px + kMapHeight_px + 20, kWidth_px - kLeft - 40, kTimeHeight_px - 100});
    return encoded(sheet_.image());
  }

 private:
  std::string axis_names() const {
    const std::string names = "xyz";
    return std::string("right: ") + names[static_cast<std::size_t>(plane_[0])] +
           ", up: " + names[static_cast<std::size_t>(plane_[1])] + ", metres";
  }
  cv::Point2d at(const Axes& axes, const Eigen::Vector3d& point) const {
    return axes.at(point[plane_[0]], point[plane_[1]]);
  }

  void draw_overlay(const cv::Rect& inside) {
    const Axes axes = map_axes(tracks_, plane_, inside);
    draw_axes(sheet_, axes, "estimates on references (grey)", axis_names());
    for (const PlottedTrack& track : tracks_) {
      std::vector<cv::Point2d> path;
      for (const PlottedPose& pose : track.poses) path.push_back(at(axes, pose.reference));
      sheet_.line(path, kReference, 5);
    }
    double legend = inside.y + 2.0 * kCapital_px;
    for (std::size_t i = 0; i < tracks_.size(); ++i) {
      std::vector<cv::Point2d> path;
      for (const PlottedPose& pose : tracks_[i].poses) path.push_back(at(axes, pose.estimate));
      sheet_.line(path, track_colour(i), 2);
      sheet_.mark_start(path.front().x, path.front().y, track_colour(i));
      sheet_.mark_end(path.back().x, path.back().y, track_colour(i));
      if (tracks_[i].name.empty()) continue;
      sheet_.line({{inside.x + 10.0, legend - 0.5 * kCapital_px}, {inside.x + 45.0, legend - 0.5 * kCapital_px}},
                  track_colour(i), 3);
      sheet_.write(ascii(tracks_[i].name), inside.x + 55.0, legend, kInk, 0.9, true);
      legend += 2.0 * kCapital_px;
    }
  }

  void draw_errors(const cv::Rect& inside) {
    const Axes axes = map_axes(tracks_, plane_, inside);
    draw_axes(sheet_, axes, "estimates, coloured by error", axis_names());
    for (const PlottedTrack& track : tracks_)
      for (std::size_t i = 1; i < track.poses.size(); ++i)
        sheet_.line({at(axes, track.poses[i - 1].estimate), at(axes, track.poses[i].estimate)},
                    error_colour(error_m(track.poses[i]) / std::max(worst_m_, 1e-12)), 4);
    const double left = inside.x + inside.width + 14.0, tick = tick_of(std::max(worst_m_, 1e-6), 5);
    for (int row = 0; row < inside.height; ++row)
      cv::line(sheet_.image(), cv::Point(static_cast<int>(left), inside.y + row),
               cv::Point(static_cast<int>(left) + 16, inside.y + row),
               error_colour(1.0 - static_cast<double>(row) / inside.height), 1);
    for (double value = 0.0; value <= worst_m_; value += tick)
      sheet_.write(number_text(value, tick) + " m", left + 22.0,
                   inside.y + inside.height * (1.0 - value / std::max(worst_m_, 1e-12)) + 0.4 * kCapital_px, kInk, 0.8);
  }

  void draw_times(const cv::Rect& inside) {
    const Axes axes{inside, 0.0, std::max(last_s_ - first_s_, 1e-6), 0.0, std::max(1.08 * worst_m_, 1e-6)};
    draw_axes(sheet_, axes, "distance from the reference, metres", "seconds since the first pose");
    for (std::size_t i = 0; i < tracks_.size(); ++i) {
      std::vector<cv::Point2d> line;
      for (const PlottedPose& pose : tracks_[i].poses) line.push_back(axes.at(pose.stamp_s - first_s_, error_m(pose)));
      sheet_.line(line, track_colour(i), 2);
    }
  }

  const std::vector<PlottedTrack>& tracks_;
  std::array<int, 2> plane_;
  Sheet sheet_;
  double first_s_ = 0.0, last_s_ = 0.0, worst_m_ = 0.0;
};

}  // namespace

std::string trajectory_plot_png(const std::vector<PlottedTrack>& tracks, const std::string& title) {
  MAPWEAVE_EXPECT(!tracks.empty(), "there is something to plot");
  for (const PlottedTrack& track : tracks) {
    MAPWEAVE_EXPECT(!track.poses.empty(), "a plotted track has poses");
    for (const PlottedPose& pose : track.poses)
      MAPWEAVE_EXPECT(pose.estimate.allFinite() && pose.reference.allFinite(), "plotted poses are finite");
  }
  return Plot(tracks, title).png();
}

}  // namespace mapweave::exporters
