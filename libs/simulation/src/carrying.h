#pragma once
// What becomes of a planned trajectory: carried away by people, tilted by the floor.

#include <mapweave/core/geometry.h>
#include <mapweave/simulation/random.h>
#include <mapweave/simulation/world_options.h>

#include <array>
#include <vector>

namespace mapweave::simulation {

struct Carry {
  double from_s, to_s;  // since the robot's start
};

// Takes the skipped parts of the path out and notes when the robot was in the air. What lies beyond the end of the path
// is left out.
SimulatedTrajectory carried_away(const SimulatedTrajectory&, const RobotOptions&, std::vector<Carry>& carries);

// A floor that is not quite flat: a sum of waves, the same for everyone who drives over it.
class FloorWaves {
 public:
  FloorWaves(double tilt_deg, std::uint64_t seed);
  Pose3 on_floor(const Pose2& world_from_robot) const;

 private:
  struct Wave {
    double x, y, phase, slope;  // radians per metre, radians, metres per metre
  };
  std::vector<Wave> waves_;  // none: flat
};

}  // namespace mapweave::simulation
