#include <mapweave/core/error.h>
#include <mapweave/matching/orb_features.h>

#include <algorithm>
#include <numeric>
#include <opencv2/features2d.hpp>
#include <tuple>

namespace mapweave::matching {

OrbFeatures orb_features(const PictureView& picture, const OrbFeatureOptions& options) {
  MAPWEAVE_EXPECT(
      picture.width > 0 && picture.height > 0 && picture.row_bytes >= static_cast<std::size_t>(picture.width),
      "a picture has pixels");
  const cv::Mat grey(picture.height, picture.width, CV_8UC1, const_cast<std::uint8_t*>(picture.pixels),
                     picture.row_bytes);
  constexpr int kEdge = 31, kFirstLevel = 0, kPointsOfTest = 2, kPatch = 31;  // OpenCV's defaults
  const auto orb = cv::ORB::create(options.features, static_cast<float>(options.scale), options.levels, kEdge,
                                   kFirstLevel, kPointsOfTest, cv::ORB::HARRIS_SCORE, kPatch, options.fast_threshold);
  std::vector<cv::KeyPoint> points;
  cv::Mat rows;
  orb->detectAndCompute(grey, cv::noArray(), points, rows);
  std::vector<int> order(points.size());
  std::iota(order.begin(), order.end(), 0);
  std::sort(order.begin(), order.end(), [&](int i, int j) {
    const cv::KeyPoint &a = points[static_cast<std::size_t>(i)], &b = points[static_cast<std::size_t>(j)];
    return std::tie(a.octave, a.pt.y, a.pt.x, a.angle, i) < std::tie(b.octave, b.pt.y, b.pt.x, b.angle, j);
  });
  OrbFeatures features;
  features.points.reserve(order.size());
  features.descriptors.reserve(order.size());
  for (const int i : order) {
    const cv::KeyPoint& point = points[static_cast<std::size_t>(i)];
    features.points.push_back({point.pt.x, point.pt.y, point.angle, static_cast<std::uint8_t>(point.octave)});
    features.descriptors.push_back(descriptor_of_bytes(rows.ptr<std::uint8_t>(i)));
  }
  return features;
}

}  // namespace mapweave::matching
