#pragma once
// Wall points registered to wall points by PCL (iterative closest point in the plane: nearest neighbours, normals that
// agree, least squares). Its templates stay behind this header: they are slow to compile.

#include <mapweave/matching/wall_point.h>

#include <Eigen/Core>
#include <memory>
#include <optional>
#include <vector>

namespace mapweave::matching {

class PointRegistration {
 public:
  // Pairs have normals within this angle of each other.
  explicit PointRegistration(const std::vector<WallPoint>& target);
  ~PointRegistration();
  PointRegistration(const PointRegistration&) = delete;
  PointRegistration& operator=(const PointRegistration&) = delete;

  struct Result {
    Eigen::Matrix4f moved = Eigen::Matrix4f::Identity();  // what brings the points from where they were
    std::size_t paired = 0;                               // points with a partner in the last round
  };
  // `points`: about where they lie in the target's frame. A round for each reach (metres): partners nearer than that.
  // Ends early where fewer than `fewest` points have one. nullopt where a round has no solution.
  std::optional<Result> refine(const std::vector<WallPoint>& points, const std::vector<double>& reaches_m,
                               std::size_t fewest) const;

 private:
  struct Clouds;
  std::unique_ptr<Clouds> clouds_;
};

// The motion in the plane that lays points on their partners of the same place in the list, by least squares (PCL). At
// least two.
Eigen::Matrix4f planar_motion(const std::vector<Point2f>& from, const std::vector<Point2f>& to);

}  // namespace mapweave::matching
