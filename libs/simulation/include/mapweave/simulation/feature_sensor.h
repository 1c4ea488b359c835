#pragma once
// A camera that hands over features instead of pictures, for long drives and many robots: landmarks on all surfaces,
// with descriptors that stay the same but for noise. A thousand frames a second and more on one core.

#include <mapweave/simulation/camera_options.h>
#include <mapweave/simulation/ray_caster.h>
#include <mapweave/simulation/world.h>

#include <array>
#include <cstdint>
#include <vector>

namespace mapweave::simulation {

using Descriptor = std::array<std::uint64_t, 4>;  // 256 bits

struct FeatureOptions {
  double landmarks_per_m2 = 50.0;
  double least_size_m = 0.02, greatest_size_m = 0.35;
  double farthest_m = 15.0;
  int most_features = 500;
  int octaves = 8;
  double octave_factor = 1.2;
  double pixel_noise = 0.4;
  double flipped_bits = 0.05;
  double missed = 0.15;
  double outliers = 0.05;
  template <class Visitor>
  void describe(Visitor& v) {
    v.number("landmarks_per_m2", landmarks_per_m2, 0.1, 1000.0,
             "on walls and furniture; a tenth of it on floor and ceiling");
    v.number("least_size_m", least_size_m, 0.001, 1.0,
             "a landmark is found where its size shows as 7 pixels times the octaves' factors");
    v.number("greatest_size_m", greatest_size_m, 0.001, 10.0,
             "sizes are spread evenly between these, by their logarithms");
    v.number("farthest_m", farthest_m, 0.5, 200.0, "nothing is found beyond");
    v.integer("most_features", most_features, 1, 100000, "in a picture");
    v.integer("octaves", octaves, 1, 16, "levels of the pyramid");
    v.number("octave_factor", octave_factor, 1.01, 2.0, "from one level to the next");
    v.number("pixel_noise", pixel_noise, 0.0, 20.0,
             "standard deviation on the lowest level; grows with the octave's factor");
    v.fraction("flipped_bits", flipped_bits, "share of a descriptor's bits that are wrong in a frame");
    v.fraction("missed", missed, "share of visible landmarks that a frame does not find");
    v.fraction("outliers", outliers, "features that no landmark stands behind, as a share of the others");
  }
};

struct SimulatedLandmark {
  Eigen::Vector3d point_in_world, normal;
  double size_m;
  std::uint64_t look;  // the same for landmarks that look the same (rooms that repeat): decides the descriptor
};
Descriptor descriptor_of(const SimulatedLandmark&);  // without noise

// The landmarks of one building. Immutable; may be used by many threads.
class LandmarkField {
 public:
  LandmarkField(const Scene&, const FloorPlan&, const FeatureOptions&);
  const std::vector<SimulatedLandmark>& landmarks() const { return landmarks_; }
  // Neither walls nor furniture between them; nothing is hidden by itself.
  bool is_in_sight(const Eigen::Vector3d& eye, const SimulatedLandmark&) const;
  // Calls visit(number) for landmarks in cells of 1 m that touch the box, in order of number within a cell.
  template <class Visit>
  void for_each_in(const Box& box, Visit&& visit) const;

 private:
  std::vector<SimulatedLandmark> landmarks_;
  RayCaster walls_;
  double low_x_ = 0.0, low_y_ = 0.0;
  int columns_ = 0, rows_ = 0;
  std::vector<std::uint32_t> first_, members_;  // cell by cell
};

constexpr std::uint32_t kNoLandmark = 0xffffffffu;

struct Feature {
  float u, v;  // pixels, distorted where the camera is
  int octave;
  float depth_m;  // rgbd; 0: none
  float right_u;  // stereo: the same row of the right picture (of an undistorted pair); -1: not seen there
  Descriptor descriptor;
  std::uint32_t landmark;  // the truth; kNoLandmark for an outlier
};

struct SimulatedFeatureFrame {
  Stamp stamp;
  Pose3 world_from_camera;  // the truth
  std::vector<Feature> features;
};

// Every frame is a pure function of the world and its number. Immutable; may be used by many threads. World and field
// must outlive it.
class FeatureRecording {
 public:
  FeatureRecording(const World&, const LandmarkField& of_its_building, const FeatureOptions&, std::size_t robot,
                   std::size_t camera);
  std::size_t frame_count() const { return frame_count_; }
  SimulatedFeatureFrame frame(std::size_t frame) const;
  const CameraModel& model() const { return model_; }

 private:
  const World* world_;
  const LandmarkField* field_;
  FeatureOptions options_;
  std::size_t robot_;
  CameraOptions camera_;
  CameraModel model_;
  Pose3 robot_from_camera_;
  std::size_t frame_count_;
  RandomStream numbers_;
};

}  // namespace mapweave::simulation
