// PCL stays in this file: its templates are slow to compile.
#include <mapweave/matching/judge.h>
#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <pcl/registration/correspondence_estimation.h>
#include <pcl/registration/correspondence_rejection_one_to_one.h>
#include <pcl/registration/correspondence_rejection_surface_normal.h>
#include <pcl/registration/transformation_estimation_2D.h>

namespace mapweave::matching {
namespace {

using Point = pcl::PointNormal;
using Cloud = pcl::PointCloud<Point>;
constexpr std::size_t kMostPoints = 600;   // of the moving side: bounds time
constexpr std::size_t kFewestPoints = 30;  // fewer are aligned by chance

Cloud::Ptr cloud_of(const SubmapModel& model, const Pose2& target_from_model) {
  auto cloud = std::make_shared<Cloud>();
  const double c = std::cos(target_from_model.phi), s = std::sin(target_from_model.phi);
  for (const auto& wall : model.walls()) {
    Point p;
    p.x = static_cast<float>(c * wall.x - s * wall.y + target_from_model.x);
    p.y = static_cast<float>(s * wall.x + c * wall.y + target_from_model.y);
    p.z = 0;
    p.normal_x = static_cast<float>(c * wall.normal_x - s * wall.normal_y);
    p.normal_y = static_cast<float>(s * wall.normal_x + c * wall.normal_y);
    p.normal_z = 0;
    cloud->push_back(p);
  }
  return cloud;
}

}  // namespace

std::optional<Verification> verify(const SubmapModel& a, const SubmapModel& b, const Pose2& a_from_b) {
  // Only walls of b where a looked: the others can have no partner.
  const auto target = cloud_of(a, {});
  const auto all = cloud_of(b, a_from_b);
  auto moving = std::make_shared<Cloud>();
  for (const auto& p : *all)
    if (a.sight().get(cell_of(p.x, 1.0 / SubmapModel::kSightResolution),
                      cell_of(p.y, 1.0 / SubmapModel::kSightResolution)) != Sight::unknown)
      moving->push_back(p);
  if (target->size() < kFewestPoints || moving->size() < kFewestPoints) return std::nullopt;
  if (moving->size() > kMostPoints) {
    auto fewer = std::make_shared<Cloud>();
    for (std::size_t i = 0; i < kMostPoints; ++i) fewer->push_back((*moving)[i * moving->size() / kMostPoints]);
    moving = fewer;
  }
  pcl::registration::CorrespondenceEstimation<Point, Point> pairing;
  pairing.setInputTarget(target);
  pcl::registration::CorrespondenceRejectorSurfaceNormal facing;
  facing.initializeDataContainer<Point, Point>();
  facing.setThreshold(0.866);  // cosine of 30 degrees
  facing.setInputTarget<Point>(target);
  facing.setTargetNormals<Point, Point>(target);
  const pcl::registration::TransformationEstimation2D<Point, Point, float> estimation;

  Eigen::Matrix4f moved = Eigen::Matrix4f::Identity();
  std::size_t paired = 0;
  for (const double reach : {0.5, 0.35, 0.25, 0.15, 0.15, 0.15}) {
    pairing.setInputSource(moving);
    pcl::Correspondences near, agreeing;
    pairing.determineCorrespondences(near, reach);
    facing.setInputSource<Point>(moving);
    facing.setInputNormals<Point, Point>(moving);
    facing.getRemainingCorrespondences(near, agreeing);
    paired = agreeing.size();
    if (paired < kFewestPoints / 2) break;
    Eigen::Matrix4f step;
    estimation.estimateRigidTransformation(*moving, *target, agreeing, step);
    if (!step.allFinite()) return std::nullopt;
    for (auto& p : *moving) {
      const Eigen::Vector4f place = step * Eigen::Vector4f(p.x, p.y, p.z, 1.0F);
      const Eigen::Vector3f normal = step.topLeftCorner<3, 3>() * Eigen::Vector3f(p.normal_x, p.normal_y, p.normal_z);
      p.x = place.x();
      p.y = place.y();
      p.normal_x = normal.x();
      p.normal_y = normal.y();
    }
    moved = (step * moved).eval();
  }
  Verification result;
  result.inliers = static_cast<double>(paired) / static_cast<double>(moving->size());
  const double c = std::cos(a_from_b.phi), s = std::sin(a_from_b.phi);
  const Eigen::Vector4f centre(static_cast<float>(c * b.centre().x - s * b.centre().y + a_from_b.x),
                               static_cast<float>(s * b.centre().x + c * b.centre().y + a_from_b.y), 0, 1);
  result.disagreement_m = static_cast<double>(((moved * centre) - centre).head<2>().norm());
  result.disagreement_rad = std::abs(std::atan2(static_cast<double>(moved(1, 0)), static_cast<double>(moved(0, 0))));
  return result;
}

}  // namespace mapweave::matching
