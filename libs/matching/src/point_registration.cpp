#include "point_registration.h"

#include <pcl/point_cloud.h>
#include <pcl/point_types.h>
#include <pcl/registration/correspondence_estimation.h>
#include <pcl/registration/correspondence_rejection_surface_normal.h>
#include <pcl/registration/transformation_estimation_2D.h>

namespace mapweave::matching {
namespace {

using Point = pcl::PointNormal;
using Cloud = pcl::PointCloud<Point>;
constexpr double kLeastCosine = 0.866;  // of 30 degrees between normals

Point pcl_point(float x, float y, float normal_x, float normal_y) {
  Point p;
  p.x = x;
  p.y = y;
  p.z = 0;
  p.normal_x = normal_x;
  p.normal_y = normal_y;
  p.normal_z = 0;
  return p;
}

Cloud::Ptr cloud_of(const std::vector<WallPoint>& walls) {
  auto cloud = std::make_shared<Cloud>();
  for (const WallPoint& wall : walls) cloud->push_back(pcl_point(wall.x, wall.y, wall.normal_x, wall.normal_y));
  return cloud;
}

}  // namespace

// Not thread-safe, as PCL's objects hold what they work on; each call sets it anew.
struct PointRegistration::Clouds {
  Cloud::Ptr target;
  pcl::registration::CorrespondenceEstimation<Point, Point> pairing;
  pcl::registration::CorrespondenceRejectorSurfaceNormal facing;

  pcl::Correspondences pairs(const Cloud::Ptr& moving, double reach_m) {
    pcl::Correspondences near, agreeing;
    pairing.setInputSource(moving);
    pairing.determineCorrespondences(near, reach_m);
    facing.setInputSource<Point>(moving);
    facing.setInputNormals<Point, Point>(moving);
    facing.getRemainingCorrespondences(near, agreeing);
    return agreeing;
  }
};

PointRegistration::PointRegistration(const std::vector<WallPoint>& target) : clouds_(std::make_unique<Clouds>()) {
  clouds_->target = cloud_of(target);
  clouds_->pairing.setInputTarget(clouds_->target);
  clouds_->facing.initializeDataContainer<Point, Point>();
  clouds_->facing.setThreshold(kLeastCosine);
  clouds_->facing.setInputTarget<Point>(clouds_->target);
  clouds_->facing.setTargetNormals<Point, Point>(clouds_->target);
}

PointRegistration::~PointRegistration() = default;

std::optional<PointRegistration::Result> PointRegistration::refine(const std::vector<WallPoint>& points,
                                                                   const std::vector<double>& reaches_m,
                                                                   std::size_t fewest) const {
  const Cloud::Ptr moving = cloud_of(points);
  const pcl::registration::TransformationEstimation2D<Point, Point, float> estimation;
  Result result;
  for (const double reach_m : reaches_m) {
    const pcl::Correspondences agreeing = clouds_->pairs(moving, reach_m);
    result.paired = agreeing.size();
    if (result.paired < fewest) break;
    Eigen::Matrix4f step;
    estimation.estimateRigidTransformation(*moving, *clouds_->target, agreeing, step);
    if (!step.allFinite()) return std::nullopt;
    for (auto& p : *moving) {
      const Eigen::Vector4f place = step * Eigen::Vector4f(p.x, p.y, p.z, 1.0F);
      const Eigen::Vector3f normal = step.topLeftCorner<3, 3>() * Eigen::Vector3f(p.normal_x, p.normal_y, p.normal_z);
      p.x = place.x();
      p.y = place.y();
      p.normal_x = normal.x();
      p.normal_y = normal.y();
    }
    result.moved = (step * result.moved).eval();
  }
  return result;
}

Eigen::Matrix4f planar_motion(const std::vector<Point2f>& from, const std::vector<Point2f>& to) {
  Cloud source, target;
  for (const Point2f& p : from) source.push_back(pcl_point(p.x, p.y, 0, 0));
  for (const Point2f& p : to) target.push_back(pcl_point(p.x, p.y, 0, 0));
  const pcl::registration::TransformationEstimation2D<Point, Point, float> estimation;
  Eigen::Matrix4f motion;
  estimation.estimateRigidTransformation(source, target, motion);
  return motion;
}

}  // namespace mapweave::matching
