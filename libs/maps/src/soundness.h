#pragma once
// What a value must be to have a byte form. One list of rules for both directions: what is written can be read again,
// and what was read can be trusted.

#include <mapweave/maps/map_update.h>

namespace mapweave {

inline constexpr std::uint32_t kMostRays = 100000;
inline constexpr double kLongestSweep_s = 10.0;  // from a scan's stamp to any of its rays
inline constexpr std::int32_t kMostGridSide = 100000;
inline constexpr std::int64_t kMostGridCells = std::int64_t{1} << 27;
inline constexpr std::size_t kMostHypotheses = 1000;
inline constexpr std::int32_t kMostPictureSide = 4096;  // what sixteenths of a pixel in 16 bits reach
inline constexpr std::size_t kMostFeatures = 100000;    // of a keyframe
inline constexpr int kMostLevel = 31;                   // of a pyramid
inline constexpr double kUnitTolerance = 1e-6;          // of a quaternion's norm

// Each says what is wrong, with what was expected; empty for a sound value.
std::string problem_with(const SessionId&);
std::string problem_with(const Pose3&);
std::string problem_with(const ScanGeometry&);
std::string problem_with(const CameraGeometry&);
std::string problem_with(const Node&);
std::string problem_with(const MovedNode&);
std::string problem_with(const Submap&);
std::string problem_with(const ConstraintId&);
std::string problem_with(const Constraint&);
std::string problem_with(const Judgement&);
std::string problem_with(const Verdict&);
bool is_proposer(const std::string& name);  // up to 256 printable letters
std::string problem_with(const Origin&);
std::string problem_with(const Landmark&);
std::string problem_with(const LandmarkChange&);

// Whether a point with fields u and v lies in the picture.
template <class Point>
bool is_inside(const Point& point, const CameraGeometry& camera) {
  return point.u < 16 * camera.width && point.v < 16 * camera.height;
}

}  // namespace mapweave
