#include <mapweave/core/error.h>
#include <mapweave/matching/orb_features.h>

#include <algorithm>
#include <opencv2/features2d.hpp>
#include <tuple>

namespace mapweave::matching {

OrbFeatures orb_features(const PictureView& picture, const OrbFeatureOptions& options) {
  MAPWEAVE_EXPECT(picture.width > 0 && picture.height > 0 && picture.row_bytes >= static_cast<std::size_t>(picture.width),
                  "a picture has pixels");
  const cv::Mat grey(picture.height, picture.width, CV_8UC1, const_cast<std::uint8_t*>(picture.pixels), picture.row_bytes);
  constexpr int kEdge = 31, kFirstLevel = 0, kPointsOfTest = 2, kPatch = 31;
  const auto orb = cv::ORB::create(options.features, static_cast<float>(options.scale), options.levels, kEdge, kFirstLevel, kPointsOfTest,
                                   cv::ORB::HARRIS_SCORE, kPatch, options.fast_threshold);
  std::vector<cv::KeyPoint> points;
  orb->detect(grey, points);
  std::sort(points.begin(), points.end(), [](const cv::KeyPoint& a, const cv::KeyPoint& b) {
    return std::tie(a.octave, a.pt.y, a.pt.x, a.angle) < std::tie(b.octave, b.pt.y, b.pt.x, b.angle);
  });
  cv::Mat rows;
  orb->compute(grey, points, rows);
  OrbFeatures features;
  for (std::size_t i = 0; i < points.size(); ++i) {
    features.points.push_back({points[i].pt.x, points[i].pt.y, points[i].angle, static_cast<std::uint8_t>(points[i].octave)});
    features.descriptors.push_back(descriptor_of_bytes(rows.ptr<std::uint8_t>(static_cast<int>(i))));
  }
  return features;
}

}  // namespace mapweave::matching
