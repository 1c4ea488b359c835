#include "fisheye.h"

#include <mapweave/core/error.h>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <cmath>

namespace mapweave::rawlog::ros {
namespace {

double bent(double angle, const std::array<double, 4>& k) {
  const double square = angle * angle;
  return angle * (1.0 + square * (k[0] + square * (k[1] + square * (k[2] + square * k[3]))));
}

// From the centre to the farthest corner, in focal lengths.
double most_radius(const mrpt::img::TCamera& camera) {
  const double x = std::max(camera.cx(), camera.ncols - camera.cx()) / camera.fx();
  const double y = std::max(camera.cy(), camera.nrows - camera.cy()) / camera.fy();
  return std::hypot(x, y);
}

}  // namespace

struct FisheyeLens::Maps {
  cv::Mat places, shares;
};

FisheyeLens::FisheyeLens(const mrpt::img::TCamera& camera, const std::array<double, 4>& k) : camera_(camera), k_(k) {
  constexpr int kSamples = 100;
  const double most = std::atan(most_radius(camera));
  double before = 0.0;
  for (int i = 1; i <= kSamples; ++i) {
    const double here = bent(most * i / kSamples, k);
    if (!(here > before) || !std::isfinite(here))
      throw Error(ErrorCode::kBadInput, "a calibration of a fisheye lens makes no sense: its picture folds back");
    before = here;
  }
}

bool FisheyeLens::is_of(const mrpt::img::TCamera& camera, const std::array<double, 4>& k) const {
  return camera == camera_ && k == k_;
}

void FisheyeLens::rectify(mrpt::img::CImage& image) {
  if (image.getWidth() != camera_.ncols || image.getHeight() != camera_.nrows) return;
  if (!maps_) {
    cv::Mat places(static_cast<int>(camera_.nrows), static_cast<int>(camera_.ncols), CV_32FC2);
    for (int v = 0; v < places.rows; ++v)
      for (int u = 0; u < places.cols; ++u) {
        const double x = (u - camera_.cx()) / camera_.fx(), y = (v - camera_.cy()) / camera_.fy();
        const double radius = std::hypot(x, y), scale = radius > 0.0 ? bent(std::atan(radius), k_) / radius : 1.0;
        places.at<cv::Vec2f>(v, u) = cv::Vec2f(static_cast<float>(camera_.fx() * x * scale + camera_.cx()),
                                               static_cast<float>(camera_.fy() * y * scale + camera_.cy()));
      }
    const auto maps = std::make_shared<Maps>();
    cv::convertMaps(places, cv::noArray(), maps->places, maps->shares, CV_16SC2);
    maps_ = maps;
  }
  cv::Mat rectified;
  cv::remap(image.asCvMat<cv::Mat>(mrpt::img::SHALLOW_COPY), rectified, maps_->places, maps_->shares, cv::INTER_LINEAR);
  image = mrpt::img::CImage(rectified, mrpt::img::SHALLOW_COPY);
}

std::array<double, 2> FisheyeLens::view_deg() const {
  const auto degrees = [](double centre, double size, double focal) {
    return (std::atan(centre / focal) + std::atan((size - centre) / focal)) * (180.0 / M_PI);
  };
  return {degrees(camera_.cx(), camera_.ncols, camera_.fx()), degrees(camera_.cy(), camera_.nrows, camera_.fy())};
}

}  // namespace mapweave::rawlog::ros
