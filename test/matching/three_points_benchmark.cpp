// The pose of a camera from three points that it sees, ours and OpenCV's: three_points_benchmark [TRIPLES]. The truth
// is found where an answer lies within 1e-4 m and rad of it.
#include <mapweave/matching/rigid_from_points.h>

#include <opencv2/calib3d.hpp>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <random>

using namespace mapweave;

namespace {

struct Triple {
  Pose3 camera_from_world;
  std::array<Eigen::Vector3d, 3> rays, points;
};

std::vector<Pose3> by_opencv(const Triple& triple, int method) {
  std::vector<cv::Point3d> points;
  std::vector<cv::Point2d> pixels;
  for (std::size_t i = 0; i < 3; ++i) {
    const Eigen::Vector3d &p = triple.points[i], &ray = triple.rays[i];
    points.emplace_back(p.x(), p.y(), p.z());
    pixels.emplace_back(ray.x() / ray.z(), ray.y() / ray.z());
  }
  std::vector<cv::Mat> turns, translations;
  cv::solveP3P(points, pixels, cv::Mat::eye(3, 3, CV_64F), cv::noArray(), turns, translations, method);
  std::vector<Pose3> poses;
  for (std::size_t i = 0; i < turns.size(); ++i) {
    const Eigen::Vector3d turn(turns[i].at<double>(0), turns[i].at<double>(1), turns[i].at<double>(2));
    Pose3 pose;
    if (turn.norm() > 0.0) pose.q = Eigen::AngleAxisd(turn.norm(), turn.normalized());
    pose.t = {translations[i].at<double>(0), translations[i].at<double>(1), translations[i].at<double>(2)};
    poses.push_back(pose);
  }
  return poses;
}

template <class Solve>
void run(const char* name, const std::vector<Triple>& triples, Solve&& solve) {
  std::vector<std::vector<Pose3>> all;
  all.reserve(triples.size());
  const std::clock_t begin = std::clock();
  for (const Triple& triple : triples) all.push_back(solve(triple));
  const double seconds = static_cast<double>(std::clock() - begin) / CLOCKS_PER_SEC;
  std::vector<double> errors;
  std::size_t answers = 0, missed = 0;
  for (std::size_t i = 0; i < triples.size(); ++i) {
    const Triple& triple = triples[i];
    const std::vector<Pose3>& poses = all[i];
    double least = 1e9;
    for (const Pose3& pose : poses)
      least = std::min(least, std::max((pose.t - triple.camera_from_world.t).norm(),
                                       pose.q.angularDistance(triple.camera_from_world.q)));
    answers += poses.size();
    missed += !(least < 1e-4);
    errors.push_back(least);
  }
  std::sort(errors.begin(), errors.end());
  const auto at = [&](double share) {
    return errors[static_cast<std::size_t>(share * static_cast<double>(errors.size() - 1))];
  };
  const auto count = static_cast<double>(triples.size());
  std::printf("%-5s %7.2f us a triple, %.3f answers, %zu missed of %zu, error %.2g (median) %.2g (99 %%)\n", name,
              1e6 * seconds / count, static_cast<double>(answers) / count, missed, triples.size(), at(0.5), at(0.99));
}

}  // namespace

int main(int argc, char** argv) {
  const int count = argc > 1 ? std::atoi(argv[1]) : 100000;
  std::mt19937_64 random(1);
  const auto uniform = [&](double low, double high) {
    return low + (high - low) * static_cast<double>(random() >> 11) * 0x1.0p-53;
  };
  std::vector<Triple> triples(static_cast<std::size_t>(count));
  for (Triple& triple : triples) {
    Eigen::Vector3d axis(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1));
    triple.camera_from_world.q = Eigen::AngleAxisd(uniform(0, M_PI), axis.normalized());
    triple.camera_from_world.t = {uniform(-5, 5), uniform(-5, 5), uniform(-5, 5)};
    for (std::size_t i = 0; i < 3; ++i) {
      const Eigen::Vector3d in_camera(uniform(-2, 2), uniform(-2, 2), uniform(1, 6));
      triple.rays[i] = in_camera.normalized();
      triple.points[i] = transformed(in_camera, inverse(triple.camera_from_world));
    }
  }
  run("ours", triples, [](const Triple& t) { return matching::poses_from_three_points(t.rays, t.points); });
  run("P3P", triples, [](const Triple& t) { return by_opencv(t, cv::SOLVEPNP_P3P); });
  run("AP3P", triples, [](const Triple& t) { return by_opencv(t, cv::SOLVEPNP_AP3P); });
}
