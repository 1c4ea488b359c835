#pragma once
// An inertial unit at the robot's origin, axes as the robot's.

#include <mapweave/simulation/random.h>
#include <mapweave/simulation/world.h>

namespace mapweave::simulation {

struct ImuReading {
  Stamp stamp;
  Eigen::Vector3d turn_rad_per_s, acceleration_m_per_s2;  // the latter with the floor's push against gravity
};

// One robot's readings in order, in constant memory. The world must outlive it. Not thread-safe; many may run at once.
class ImuRecording {
 public:
  ImuRecording(const World& world, std::size_t robot);
  std::size_t count() const { return count_; }  // 0 where the world has no inertial units
  Stamp stamp() const;                          // of the next one
  std::optional<ImuReading> next();

 private:
  double seconds(std::size_t reading) const;
  const World* world_;
  std::size_t robot_, count_ = 0, next_ = 0;
  ImuOptions options_;
  RandomStream numbers_;
  Eigen::Vector3d turn_bias_, acceleration_bias_;
};

}  // namespace mapweave::simulation
