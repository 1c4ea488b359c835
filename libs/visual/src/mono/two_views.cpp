#include "two_views.h"

#include "geometry/bundle_sighting.h"

#include <mapweave/core/median.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/calib3d.hpp>

namespace mapweave::visual {
namespace {

using Eigen::Vector3d;

struct RayPair {
  Vector3d first, second;  // z = 1
  double sigma = 0.0;      // on the plane z = 1
};

// Where the rays meet, if that is what both pictures show.
std::optional<Vector3d> agreed_point(const RayPair& pair, const View& motion, double gate_sigmas) {
  const auto point = meet(pair.first, pair.second, motion);
  if (!point) return std::nullopt;
  const Vector3d there = motion * *point;
  const double error = std::max((there.head<2>() / there.z() - pair.second.head<2>()).squaredNorm(),
                                (point->head<2>() / point->z() - pair.first.head<2>()).squaredNorm());
  if (!(error < gate_sigmas * gate_sigmas * pair.sigma * pair.sigma)) return std::nullopt;
  return point;
}

// Points from the pairs, then both made better together.
TwoViews settled(const std::vector<PixelPair>& pairs, const std::vector<RayPair>& rays, const Pinhole& camera,
                 View motion, const TwoViewOptions& options) {
  TwoViews result;
  for (double wider : {4.0, 1.5}) {
    graph::Bundle bundle;
    bundle.cameras.push_back(camera);
    bundle.views = {{View(), 0, true}, {motion, 0, false}};
    std::vector<std::size_t> pair_of_point;
    for (std::size_t i = 0; i < pairs.size(); ++i) {
      const auto point = agreed_point(rays[i], motion, wider * options.gate_sigmas);
      if (!point) continue;
      const std::array<Eigen::Vector2d, 2> pixels{pairs[i].first, pairs[i].second};
      for (int side = 0; side < 2; ++side) {
        Sighting seen;
        seen.pixel = pixels[static_cast<std::size_t>(side)];
        seen.sigma_px = pairs[i].sigma_px;
        bundle.sightings.push_back(bundle_sighting(side, bundle.points.size(), seen));
      }
      bundle.points.push_back(*point);
      pair_of_point.push_back(i);
    }
    graph::BundleOptions adjusting = bundle_options(10);
    adjusting.gate_sigmas = options.gate_sigmas;
    graph::adjust(bundle, adjusting);
    const double length = bundle.views[1].view.translation.norm();
    if (!(length > 1e-9)) break;
    motion = bundle.views[1].view;
    motion.translation /= length;
    result = TwoViews();
    result.second_from_first = motion;
    result.points.assign(pairs.size(), Vector3d::Zero());
    result.fits.assign(pairs.size(), 0);
    std::vector<double> angles;
    const Vector3d centre = motion.centre();
    for (std::size_t p = 0; p < bundle.points.size(); ++p) {
      const Vector3d point = bundle.points[p] / length;
      if (!bundle.sightings[2 * p].fits || !bundle.sightings[2 * p + 1].fits) continue;
      result.points[pair_of_point[p]] = point;
      result.fits[pair_of_point[p]] = 1;
      ++result.count;
      angles.push_back(std::atan2(point.cross(point - centre).norm(), point.dot(point - centre)));
    }
    if (angles.empty()) break;
    result.parallax_rad = median(std::move(angles));
  }
  return result;
}

int count_in_front(const std::vector<RayPair>& rays, const View& motion, const TwoViewOptions& options) {
  return static_cast<int>(std::count_if(rays.begin(), rays.end(), [&](const RayPair& pair) {
    return agreed_point(pair, motion, options.gate_sigmas).has_value();
  }));
}

bool is_alike(const View& a, const View& b) {
  constexpr double kTurn_rad = 0.03, kDirection = 0.97;  // within which two motions are one
  return Eigen::AngleAxisd(a.rotation.transpose() * b.rotation).angle() < kTurn_rad &&
         a.translation.dot(b.translation) > kDirection;
}

}  // namespace

std::optional<Vector3d> meet(const Vector3d& ray_in_first, const Vector3d& ray_in_second,
                             const View& second_from_first) {
  const Vector3d a = ray_in_second.cross(second_from_first.rotation * ray_in_first),
                 b = ray_in_second.cross(second_from_first.translation);
  // a + inverse_depth * b = 0: well determined by both ends only where neither is near to nothing.
  const double inverse_depth = -a.dot(b) / b.squaredNorm();
  if (!(inverse_depth > 1e-6 && std::isfinite(inverse_depth))) return std::nullopt;
  const Vector3d point = ray_in_first / (inverse_depth * ray_in_first.z());
  if (!((second_from_first * point).z() > 0.0)) return std::nullopt;
  return point;
}

namespace {

View view_of(const cv::Mat& rotation, const cv::Mat& translation) {
  View view;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) view.rotation(i, j) = rotation.at<double>(i, j);
    view.translation(i) = translation.at<double>(i);
  }
  view.translation.normalize();
  return view;
}

double middle_sigma_px(const std::vector<PixelPair>& pairs) {
  std::vector<double> sigmas;
  for (const PixelPair& pair : pairs) sigmas.push_back(pair.sigma_px);
  return median(std::move(sigmas));
}

// Of an essential matrix four, of a homography at most four, none of it where nothing but rotation is seen.
std::vector<View> proposed_motions(const std::vector<PixelPair>& pairs, const Pinhole& camera, double gate_sigmas) {
  std::vector<cv::Point2d> first, second;
  for (const PixelPair& pair : pairs) {
    first.emplace_back(pair.first.x(), pair.first.y());
    second.emplace_back(pair.second.x(), pair.second.y());
  }
  const cv::Matx33d pinhole(camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
  const double gate_px = gate_sigmas * middle_sigma_px(pairs);
  constexpr double kSurely = 0.999, kLeastMotion = 1e-9;
  std::vector<View> proposed;
  const cv::Mat essential = cv::findEssentialMat(first, second, pinhole, cv::USAC_MAGSAC, kSurely, gate_px);
  if (!essential.empty()) {
    cv::Mat one, other, t;
    cv::decomposeEssentialMat(essential.rowRange(0, 3), one, other, t);
    for (const cv::Mat& rotation : {one, other})
      for (const double sign : {1.0, -1.0}) proposed.push_back(view_of(rotation, sign * t));
  }
  const cv::Mat homography = cv::findHomography(first, second, cv::USAC_MAGSAC, gate_px);
  if (homography.empty()) return proposed;
  std::vector<cv::Mat> rotations, translations, normals;
  cv::decomposeHomographyMat(homography, pinhole, rotations, translations, normals);
  for (std::size_t i = 0; i < rotations.size(); ++i)
    if (cv::norm(translations[i]) > kLeastMotion) proposed.push_back(view_of(rotations[i], translations[i]));
  return proposed;
}

}  // namespace

std::optional<TwoViews> relate_views(const std::vector<PixelPair>& pairs, const Pinhole& camera,
                                     const TwoViewOptions& options) {
  if (pairs.size() < static_cast<std::size_t>(options.least_pairs)) return std::nullopt;
  const std::vector<View> proposed = proposed_motions(pairs, camera, options.gate_sigmas);
  std::vector<RayPair> rays;
  for (const PixelPair& pair : pairs)
    rays.push_back({camera.ray(pair.first), camera.ray(pair.second), pair.sigma_px / std::sqrt(camera.fx * camera.fy)});
  std::vector<int> counts;
  for (const View& motion : proposed) counts.push_back(count_in_front(rays, motion, options));

  // A poor start may lead to a good end: half as good as the best is good enough to be tried.
  const int most = counts.empty() ? 0 : *std::max_element(counts.begin(), counts.end());
  std::vector<TwoViews> ends;
  for (std::size_t i = 0; i < proposed.size(); ++i)
    if (2 * counts[i] >= most && counts[i] > 0) ends.push_back(settled(pairs, rays, camera, proposed[i], options));
  const auto best = std::max_element(ends.begin(), ends.end(),
                                     [](const TwoViews& a, const TwoViews& b) { return a.count < b.count; });
  if (best == ends.end() || best->count < options.least_pairs ||
      best->count < options.least_share * static_cast<double>(pairs.size()) ||
      best->parallax_rad < options.least_parallax_rad)
    return std::nullopt;
  for (const TwoViews& other : ends)
    if (other.count > options.distinct * best->count && !is_alike(other.second_from_first, best->second_from_first))
      return std::nullopt;
  return std::move(*best);
}

}  // namespace mapweave::visual
