#pragma once
// Paper, letters and lines for pictures that people look at.

#include <opencv2/core.hpp>

#include <string>
#include <vector>

namespace mapweave::exporters {

inline const cv::Scalar kInk(40, 40, 40), kPaper(255, 255, 255);  // blue, green, red

// As PNG. Throws Error(kUnsupported) where it is too large for that.
std::string encoded(const cv::Mat& image);
// Only what the font has.
std::string ascii(const std::string& text);
std::string metres(double length_m, int decimals);

// One size of letters from which all else follows.
class Sheet {
 public:
  Sheet(int width_px, int height_px, double capital_px)
      : image_(height_px, width_px, CV_8UC3, kPaper), capital_px_(capital_px) {}
  cv::Mat& image() { return image_; }
  double capital_px() const { return capital_px_; }
  int line_px() const;

  // `left`, `base`: of the first letter's foot.
  void write(const std::string& text, double left, double base, const cv::Scalar& colour, double size = 1.0,
             bool halo = false);
  static int width_of(const std::string& text, double capital_px, double size = 1.0);
  void mark_start(double x, double y, const cv::Scalar& colour);
  void mark_end(double x, double y, const cv::Scalar& colour);
  void line(const std::vector<cv::Point2d>& points, const cv::Scalar& colour, int width_px);

 private:
  int stroke_px(double size) const;
  cv::Mat image_;
  double capital_px_;
};

}  // namespace mapweave::exporters
