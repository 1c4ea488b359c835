#include <mapweave/simulation/laser_sensor.h>

namespace mapweave::simulation {

LaserSensor::LaserSensor(const RayCaster& building, const SimulatedLaserOptions& options)
    : building_(&building), options_(options) {
  for (int ray = 0; ray < options.rays; ++ray) {
    const double angle = options.robot_from_laser().phi + options.first_angle_rad() + ray * options.angle_step_rad();
    directions_.push_back({std::cos(angle), std::sin(angle)});
  }
}

std::vector<Disc> LaserSensor::in_view(const Pose2& world_from_robot, const std::vector<Disc>& moving) const {
  const Pose2 world_from_laser = compose(world_from_robot, options_.robot_from_laser());
  std::vector<Disc> seen;
  for (const Disc& disc : moving) {
    const double away =
        std::hypot(disc.centre_in_world.x - world_from_laser.x, disc.centre_in_world.y - world_from_laser.y);
    if (away > disc.radius_m && away - disc.radius_m < options_.max_range_m) seen.push_back(disc);
  }
  return seen;
}

float LaserSensor::range(const Pose2& world_from_robot, std::size_t ray, const std::vector<Disc>& in_view,
                         RandomNumbers& noise) const {
  const Pose2 world_from_laser = compose(world_from_robot, options_.robot_from_laser());
  const Point2 origin{world_from_laser.x, world_from_laser.y};
  const double c = std::cos(world_from_robot.phi), s = std::sin(world_from_robot.phi);
  const double dx = c * directions_[ray].x - s * directions_[ray].y,
               dy = s * directions_[ray].x + c * directions_[ray].y;
  double range = building_->distance(origin, dx, dy, options_.max_range_m);
  for (const Disc& disc : in_view)
    range = std::min(range, distance_along_ray(origin, dx, dy, disc.centre_in_world, disc.radius_m));
  const double luck = noise.uniform();
  if (luck < options_.dropouts) return 0.0f;
  if (luck < options_.dropouts + options_.outliers) {
    range = noise.uniform(0.0, std::min(range, options_.max_range_m));
  } else if (range < options_.max_range_m) {
    range += noise.normal() * (options_.noise_m + options_.noise_per_m * range);
  }
  return range > 0.0 && range < options_.max_range_m ? static_cast<float>(range) : 0.0f;
}

std::vector<float> LaserSensor::scan(const Pose2& world_from_robot, const std::vector<Disc>& moving,
                                     RandomNumbers noise) const {
  const auto seen = in_view(world_from_robot, moving);
  std::vector<float> ranges(directions_.size());
  for (std::size_t ray = 0; ray < ranges.size(); ++ray) ranges[ray] = range(world_from_robot, ray, seen, noise);
  return ranges;
}

std::vector<float> LaserSensor::swept_scan(const std::function<Pose2(double)>& world_from_robot,
                                           const std::vector<Disc>& moving, RandomNumbers noise) const {
  const auto seen = in_view(world_from_robot(0.0), moving);
  std::vector<float> ranges(directions_.size());
  for (std::size_t ray = 0; ray < ranges.size(); ++ray)
    ranges[ray] = range(world_from_robot(options_.first_ray_s() + static_cast<double>(ray) * options_.ray_step_s()),
                        ray, seen, noise);
  return ranges;
}

}  // namespace mapweave::simulation
