#include "drawing.h"

#include "number_text.h"

#include <mapweave/core/error.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

namespace mapweave::exporters {
namespace {

constexpr int kFont = cv::FONT_HERSHEY_SIMPLEX;
constexpr double kCapitalOfFontPx = 21.0;  // height of a capital letter at scale 1
constexpr int kFineBits = 4;               // sixteenths of a pixel

int fine(double px) { return static_cast<int>(std::lround(std::clamp(px, -1e6, 1e6) * (1 << kFineBits))); }
cv::Point fine(double x, double y) { return {fine(x), fine(y)}; }

}  // namespace

std::string encoded(const cv::Mat& image) {
  std::vector<std::uint8_t> bytes;
  try {
    if (cv::imencode(".png", image, bytes, {cv::IMWRITE_PNG_COMPRESSION, 6}))
      return std::string(bytes.begin(), bytes.end());
  } catch (const cv::Exception& error) {
    throw Error(ErrorCode::kUnsupported,
                "a picture of " + std::to_string(image.cols) + " x " + std::to_string(image.rows) +
                    " pixels cannot be encoded: " + error.err,
                {}, "choose a larger cell");
  }
  throw Error(ErrorCode::kInternal, "PNG encoding failed");
}

// Only what the font has.
std::string ascii(const std::string& text) {
  std::string result;
  for (const char c : text) {
    if ((static_cast<unsigned char>(c) & 0xc0) == 0x80) continue;  // the rest of a letter beyond ASCII
    result += c >= ' ' && c <= '~' ? c : '?';
  }
  return result;
}

std::string metres(double length_m, int decimals) {
  std::string text;
  append_fixed(text, length_m, decimals);
  return text + " m";
}

int Sheet::line_px() const { return std::max(2, static_cast<int>(std::lround(capital_px_ / 9.0))); }
int Sheet::stroke_px(double size) const {
  return std::max(1, static_cast<int>(std::lround(size * capital_px_ / 10.0)));
}

void Sheet::write(const std::string& text, double left, double base, const cv::Scalar& colour, double size, bool halo) {
  const cv::Point at(static_cast<int>(std::lround(left)), static_cast<int>(std::lround(base)));
  const double scale = size * capital_px_ / kCapitalOfFontPx;
  if (halo) cv::putText(image_, text, at, kFont, scale, kPaper, stroke_px(size) + 2 * line_px(), cv::LINE_AA);
  cv::putText(image_, text, at, kFont, scale, colour, stroke_px(size), cv::LINE_AA);
}

int Sheet::width_of(const std::string& text, double capital_px, double size) {
  int below = 0;
  const int stroke = std::max(1, static_cast<int>(std::lround(size * capital_px / 10.0)));
  return cv::getTextSize(text, kFont, size * capital_px / kCapitalOfFontPx, stroke, &below).width;
}

void Sheet::mark_start(double x, double y, const cv::Scalar& colour) {
  const double radius = 0.42 * capital_px_;
  cv::circle(image_, fine(x, y), fine(radius), kPaper, cv::FILLED, cv::LINE_AA, kFineBits);
  cv::circle(image_, fine(x, y), fine(radius), colour, line_px() + 1, cv::LINE_AA, kFineBits);
}

void Sheet::mark_end(double x, double y, const cv::Scalar& colour) {
  const double half = 0.42 * capital_px_;
  cv::rectangle(image_, fine(x - half, y - half), fine(x + half, y + half), colour, cv::FILLED, cv::LINE_AA, kFineBits);
  cv::rectangle(image_, fine(x - half, y - half), fine(x + half, y + half), kInk, 1, cv::LINE_AA, kFineBits);
}

void Sheet::line(const std::vector<cv::Point2d>& points, const cv::Scalar& colour, int width_px) {
  std::vector<cv::Point> fine_points;
  for (const auto& point : points) fine_points.push_back(fine(point.x, point.y));
  cv::polylines(image_, fine_points, false, colour, width_px, cv::LINE_AA, kFineBits);
}

}  // namespace mapweave::exporters
