// How two pictures of one camera lie to each other: motions proposed by ours and by OpenCV, the same refinement and
// choice after both. two_views_benchmark [WORLDS]: of each kind, with 150 pairs of pixels, noise of half a pixel
// (even), and 0, 20 or 40 % of wrong pairs. A motion is right within 0.03 rad of rotation and 0.15 rad of direction.
#include "mono/two_views.h"

#include <opencv2/calib3d.hpp>

#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <random>

using namespace mapweave;
using namespace mapweave::visual;

namespace {

const Pinhole camera{640, 480, 500.0, 500.0, 319.5, 239.5};

enum class World { room, wall, corner };

struct Draws {
  std::mt19937_64 random;
  double operator()(double low, double high) {
    return low + (high - low) * static_cast<double>(random() >> 11) * 0x1.0p-53;
  }
};

struct Case {
  View truth;
  std::vector<PixelPair> pairs;
};

Case drawn(World world, double wrong, std::uint64_t seed) {
  Draws draw{std::mt19937_64(seed)};
  Eigen::Matrix<double, 6, 1> motion;
  motion << draw(-0.4, 0.4), draw(-0.2, 0.2), draw(-0.4, 0.4), draw(-0.05, 0.05), draw(-0.08, 0.08), draw(-0.05, 0.05);
  Case result{moved(View(), motion), {}};
  while (result.pairs.size() < 150) {
    const Eigen::Vector2d pixel(draw(20, 620), draw(20, 460));
    const Eigen::Vector3d ray = camera.ray(pixel);
    const double wall = 3.0 / (1.0 + 0.5 * ray.x() - 0.2 * ray.y()), other = 3.5 / (1.0 - 0.7 * ray.x());
    const double depth = world == World::room ? draw(2.0, 6.0) : world == World::wall ? wall : std::min(wall, other);
    const Eigen::Vector3d there = result.truth * (ray * depth);
    if (there.z() < 0.1) continue;
    const auto noise = [&] { return Eigen::Vector2d(draw(-0.5, 0.5), draw(-0.5, 0.5)); };
    PixelPair pair{pixel + noise(), camera.project(there) + noise(), 0.5};
    if (draw(0, 1) < wrong) pair.second += Eigen::Vector2d(draw(-40, 40), draw(-40, 40));
    result.pairs.push_back(pair);
  }
  return result;
}

View view_of(const cv::Mat& rotation, const cv::Mat& translation) {
  View view;
  for (int i = 0; i < 3; ++i) {
    for (int j = 0; j < 3; ++j) view.rotation(i, j) = rotation.at<double>(i, j);
    view.translation(i) = translation.at<double>(i);
  }
  view.translation.normalize();
  return view;
}

std::vector<View> proposed_by_opencv(const std::vector<PixelPair>& pairs, int method) {
  std::vector<cv::Point2d> first, second;
  for (const PixelPair& pair : pairs) {
    first.emplace_back(pair.first.x(), pair.first.y());
    second.emplace_back(pair.second.x(), pair.second.y());
  }
  const cv::Mat k = (cv::Mat_<double>(3, 3) << camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
  std::vector<View> proposed;
  cv::Mat essential = cv::findEssentialMat(first, second, k, method, 0.999, 1.5);
  for (int i = 0; i + 3 <= essential.rows; i += 3) {
    cv::Mat one, other, t;
    cv::decomposeEssentialMat(essential.rowRange(i, i + 3), one, other, t);
    for (const cv::Mat& rotation : {one, other})
      for (const double sign : {1.0, -1.0}) proposed.push_back(view_of(rotation, sign * t));
  }
  const cv::Mat homography = cv::findHomography(first, second, method, 2.0);
  if (homography.empty()) return proposed;
  std::vector<cv::Mat> rotations, translations, normals;
  cv::decomposeHomographyMat(homography, k, rotations, translations, normals);
  for (std::size_t i = 0; i < rotations.size(); ++i)
    if (cv::norm(translations[i]) > 1e-9) proposed.push_back(view_of(rotations[i], translations[i]));
  return proposed;
}

struct Tally {
  int right = 0, wrong = 0, none = 0;
  double seconds = 0.0;
  std::vector<double> turns_rad, directions_rad;
};

double middle_of(std::vector<double> values) {
  if (values.empty()) return 0.0;
  std::nth_element(values.begin(), values.begin() + static_cast<std::ptrdiff_t>(values.size() / 2), values.end());
  return values[values.size() / 2];
}

template <class Propose>
void count(const Case& made, Tally& tally, Propose&& propose) {
  const std::clock_t begin = std::clock();
  const std::vector<View> proposed = propose(made.pairs);
  tally.seconds += static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  TwoViewOptions options;
  options.least_share = 0.4;
  const auto found = best_motion(made.pairs, camera, proposed, options);
  if (!found) {
    ++tally.none;
    return;
  }
  const View& view = found->second_from_first;
  const double turn = Eigen::AngleAxisd(view.rotation.transpose() * made.truth.rotation).angle();
  const double direction = std::acos(std::min(1.0, view.translation.dot(made.truth.translation.normalized())));
  const bool is_right = turn < 0.03 && direction < 0.15;
  ++(is_right ? tally.right : tally.wrong);
  if (!is_right) return;
  tally.turns_rad.push_back(turn);
  tally.directions_rad.push_back(direction);
}

}  // namespace

int main(int argc, char** argv) {
  const int worlds = argc > 1 ? std::atoi(argv[1]) : 200;
  cv::setNumThreads(1);
  const char* const kinds[] = {"room", "wall", "corner"};
  for (const World world : {World::room, World::wall, World::corner})
    for (const double wrong : {0.0, 0.2, 0.4}) {
      Tally ours, ransac, magsac;
      for (int i = 0; i < worlds; ++i) {
        const Case made = drawn(world, wrong, static_cast<std::uint64_t>(i));
        count(made, ours, [](const auto& pairs) { return propose_motions(pairs, camera, {}); });
        count(made, ransac, [](const auto& pairs) { return proposed_by_opencv(pairs, cv::RANSAC); });
        count(made, magsac, [](const auto& pairs) { return proposed_by_opencv(pairs, cv::USAC_MAGSAC); });
      }
      const auto print = [&](const char* name, const Tally& tally) {
        std::printf("%-6s %2.0f %% wrong  %-8s %4d right %3d wrong %3d none  %.4f rad %.4f rad  %7.3f ms\n",
                    kinds[static_cast<int>(world)], 100.0 * wrong, name, tally.right, tally.wrong, tally.none,
                    middle_of(tally.turns_rad), middle_of(tally.directions_rad), 1e3 * tally.seconds / worlds);
      };
      print("ours", ours);
      print("RANSAC", ransac);
      print("MAGSAC", magsac);
    }
}
