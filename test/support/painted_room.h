#pragma once
// A box-shaped room with painted walls, as a camera inside sees it: pictures and depth by ray casting, exact and
// without noise.

#include <mapweave/core/geometry.h>
#include <mapweave/visual/frame.h>

#include <algorithm>
#include <cmath>

namespace mapweave::test {

// Smooth blobs of many sizes, from a hash of the lattice: the same everywhere and always.
inline double painted(double u, double v, unsigned wall) {
  const auto lattice = [wall](long x, long y, unsigned octave) {
    std::uint64_t h = static_cast<std::uint64_t>(x) * 0x9E3779B97F4A7C15ULL ^
                      static_cast<std::uint64_t>(y) * 0xC2B2AE3D27D4EB4FULL ^
                      (wall * 31ULL + octave) * 0x165667B19E3779F9ULL;
    h ^= h >> 29;
    h *= 0xBF58476D1CE4E5B9ULL;
    h ^= h >> 32;
    return static_cast<double>(h & 0xFFFF) / 65535.0;
  };
  double value = 0, weight = 0, scale = 2.2, share = 1.0;
  for (unsigned octave = 0; octave < 3; ++octave, scale *= 2.2, share *= 0.8) {
    const double x = u * scale, y = v * scale, floor_x = std::floor(x), floor_y = std::floor(y);
    const double fx = x - floor_x, fy = y - floor_y, sx = fx * fx * (3 - 2 * fx), sy = fy * fy * (3 - 2 * fy);
    const long ix = static_cast<long>(floor_x), iy = static_cast<long>(floor_y);
    const double upper = lattice(ix, iy, octave) * (1 - sx) + lattice(ix + 1, iy, octave) * sx;
    const double lower = lattice(ix, iy + 1, octave) * (1 - sx) + lattice(ix + 1, iy + 1, octave) * sx;
    value += share * (upper * (1 - sy) + lower * sy);
    weight += share;
  }
  return value / weight;
}

struct PaintedRoom {
  Eigen::Vector3d half{4.0, 1.5, 4.0};  // the room's walls are so far from its middle
  Pinhole camera{320, 240, 260.0, 260.0, 159.5, 119.5};

  // Distance along the ray to the wall, and its grey value.
  std::pair<double, double> look(const Eigen::Vector3d& from, const Eigen::Vector3d& ray) const {
    double nearest = 1e9;
    int axis = 0;
    for (int i = 0; i < 3; ++i) {
      if (ray[i] == 0.0) continue;
      const double t = ((ray[i] > 0 ? half[i] : -half[i]) - from[i]) / ray[i];
      if (t < nearest) {
        nearest = t;
        axis = i;
      }
    }
    const Eigen::Vector3d p = from + nearest * ray;
    const unsigned wall = static_cast<unsigned>(2 * axis + (ray[axis] > 0 ? 1 : 0));
    return {nearest, painted(p[(axis + 1) % 3], p[(axis + 2) % 3], wall)};
  }

  // room_from_camera: optical frame. `readout`: the camera's pose at the first and the last row (rolling shutter).
  visual::Frame frame(Stamp stamp, const Pose3& first, const Pose3& last) const {
    visual::Frame result;
    result.stamp = stamp;
    result.grey = visual::GreyImage(camera.width, camera.height);
    result.depth.image = visual::DepthImage(camera.width, camera.height);
    result.depth.camera = camera;
    for (int y = 0; y < camera.height; ++y) {
      const double share = (y + 0.5) / camera.height;
      const Pose3 pose{first.t + share * (last.t - first.t), first.q.slerp(share, last.q)};
      for (int x = 0; x < camera.width; ++x) {
        const auto [depth, grey] = look(pose.t, pose.q * camera.ray({static_cast<double>(x), static_cast<double>(y)}));
        result.grey.row(y)[x] =
            static_cast<std::uint8_t>(std::lround(30.0 + 200.0 * std::clamp(1.8 * grey - 0.4, 0.0, 1.0)));
        result.depth.image.row(y)[x] = static_cast<std::uint16_t>(std::lround(std::min(65.0, depth) * 1000.0));
      }
    }
    return result;
  }
  visual::Frame frame(Stamp stamp, const Pose3& pose) const { return frame(stamp, pose, pose); }
  // With a right camera so far to the right, and no depth.
  visual::Frame pair(Stamp stamp, const Pose3& pose, double baseline_m) const {
    visual::Frame result = frame(stamp, pose);
    result.right = frame(stamp, compose(pose, Pose3{{baseline_m, 0.0, 0.0}, Eigen::Quaterniond::Identity()})).grey;
    result.depth = {};
    return result;
  }
};

// A camera at (x, z) in the room, turned about the vertical.
inline Pose3 standing(double x, double z, double turn_rad, double tilt_rad = 0.0) {
  return {{x, 0.0, z},
          Eigen::Quaterniond(Eigen::AngleAxisd(turn_rad, Eigen::Vector3d::UnitY())) *
              Eigen::Quaterniond(Eigen::AngleAxisd(tilt_rad, Eigen::Vector3d::UnitX()))};
}

}  // namespace mapweave::test
