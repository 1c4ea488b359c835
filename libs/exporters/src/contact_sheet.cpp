#include <mapweave/exporters/contact_sheet.h>

#include "drawing.h"

#include <mapweave/core/error.h>

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace mapweave::exporters {
namespace {

// Colours that differ for any colour vision: orange near, yellow, sky, blue far, by the frame's own range.
cv::Scalar colour_of(double share) {
  static const cv::Scalar kScale[] = {{0, 94, 213}, {0, 159, 230}, {66, 228, 240}, {233, 180, 86}, {178, 114, 0}};
  const double place = std::clamp(share, 0.0, 1.0) * 4.0;
  const int first = std::min(3, static_cast<int>(place));
  return kScale[first] + (place - first) * (kScale[first + 1] - kScale[first]);
}

// Of a frame's pixels, at this width.
cv::Mat resized(const SheetFrame& frame, int width_px) {
  MAPWEAVE_EXPECT(
      frame.width > 0 && frame.height > 0 &&
          frame.grey.size() == static_cast<std::size_t>(frame.width) * static_cast<std::size_t>(frame.height),
      "a frame of a contact sheet has its pixels");
  const cv::Mat grey(frame.height, frame.width, CV_8U, const_cast<std::uint8_t*>(frame.grey.data()));
  const double zoom = static_cast<double>(width_px) / frame.width;
  cv::Mat result;
  cv::resize(grey, result, {width_px, std::max(1, static_cast<int>(std::lround(frame.height * zoom)))}, 0, 0,
             zoom < 1.0 ? cv::INTER_AREA : cv::INTER_LINEAR);
  return result;
}

cv::Mat drawn(const SheetFrame& frame, int width_px) {
  const double zoom = static_cast<double>(width_px) / frame.width;
  cv::Mat result;
  cv::cvtColor(resized(frame, width_px), result, cv::COLOR_GRAY2BGR);
  std::vector<float> depths;
  for (const SheetTrack& track : frame.tracks) depths.push_back(track.depth_m);
  std::sort(depths.begin(), depths.end());
  const auto rank = [&](float depth) {
    return static_cast<double>(std::lower_bound(depths.begin(), depths.end(), depth) - depths.begin()) /
           std::max<double>(1.0, static_cast<double>(depths.size()));
  };
  constexpr int kBits = 4;
  const auto fine = [&](double px) {
    return static_cast<int>(std::lround(std::clamp(px * zoom, -1e6, 1e6) * (1 << kBits)));
  };
  for (const SheetTrack& track : frame.tracks) {
    if (track.pixels.empty()) continue;
    const cv::Scalar colour = colour_of(rank(track.depth_m));
    std::vector<cv::Point> line;
    for (const auto& [u, v] : track.pixels) line.emplace_back(fine(u), fine(v));
    cv::polylines(result, line, false, colour, 1, cv::LINE_AA, kBits);
    cv::circle(result, line.back(), 2 << kBits, colour, cv::FILLED, cv::LINE_AA, kBits);
  }
  return result;
}

}  // namespace

SheetFrame shrunk(SheetFrame frame, int width_px) {
  if (frame.width <= width_px) return frame;
  const cv::Mat small = resized(frame, width_px);
  const float zoom = static_cast<float>(width_px) / static_cast<float>(frame.width);
  for (SheetTrack& track : frame.tracks)
    for (auto& [u, v] : track.pixels) {
      u *= zoom;
      v *= zoom;
    }
  frame.width = small.cols;
  frame.height = small.rows;
  frame.grey.assign(small.datastart, small.dataend);
  frame.grey.shrink_to_fit();
  return frame;
}

std::string contact_sheet_png(const std::vector<SheetFrame>& frames, const ContactSheetOptions& options) {
  MAPWEAVE_EXPECT(!frames.empty() && options.columns > 0 && options.picture_width_px >= 64,
                  "a contact sheet has frames and columns");
  constexpr double kCapital = 10.0;
  constexpr int kGap = 12, kCaption = 24;
  const int columns = std::min(options.columns, static_cast<int>(frames.size()));
  const int rows = (static_cast<int>(frames.size()) + columns - 1) / columns;
  int height = 0;
  for (const SheetFrame& frame : frames)
    height = std::max(height, 1 + options.picture_width_px * frame.height / std::max(1, frame.width));
  const int top = options.title.empty() ? kGap : 3 * kCaption / 2;
  Sheet sheet(columns * (options.picture_width_px + kGap) + kGap, top + rows * (height + kCaption + kGap), kCapital);
  if (!options.title.empty()) sheet.write(ascii(options.title), kGap, top - 0.6 * kCapital, kInk, 1.2);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    const int left = kGap + static_cast<int>(i) % columns * (options.picture_width_px + kGap),
              upper = top + static_cast<int>(i) / columns * (height + kCaption + kGap);
    const cv::Mat picture = drawn(frames[i], options.picture_width_px);
    picture.copyTo(sheet.image()(cv::Rect(left, upper, picture.cols, picture.rows)));
    sheet.write(ascii(frames[i].caption), left, upper + picture.rows + 1.5 * kCapital, kInk);
  }
  return encoded(sheet.image());
}

}  // namespace mapweave::exporters
