#include <mapweave/simulation/light.h>

#include <algorithm>
#include <cmath>

namespace mapweave::simulation {
namespace {

constexpr double kLongestExposure = 3.0;  // times that of full light
constexpr double kMostAmplified = 8.0;

}  // namespace

double LightOptions::exposure_factor() const { return std::min(1.0 / level, kLongestExposure); }
double LightOptions::amplification() const { return std::min(1.0 / (level * exposure_factor()), kMostAmplified); }
double LightOptions::brightness() const { return std::min(1.0, level * exposure_factor() * amplification()); }

double LightOptions::share_at(const Eigen::Vector3d& point_in_world) const {
  const auto wave = [&](double metres) { return 0.5 + 0.5 * std::cos(2.0 * M_PI * metres / lamp_spacing_m); };
  return 1.0 - lamps + lamps * wave(point_in_world.x()) * wave(point_in_world.y());
}

}  // namespace mapweave::simulation
