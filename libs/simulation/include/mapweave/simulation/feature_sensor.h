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
             "landmarks per square metre of walls and furniture; floor and ceiling have a tenth of that; larger values "
             "give more features");
    v.number("least_size_m", least_size_m, 0.001, 1.0,
             "size in metres of the smallest landmark; a landmark is found where its size shows as 7 pixels times an "
             "octave's factor; larger values give fewer features near by");
    v.number("greatest_size_m", greatest_size_m, 0.001, 10.0,
             "size in metres of the largest landmark; the logarithms of sizes are spread evenly; larger values give "
             "more features far away");
    v.number("farthest_m", farthest_m, 0.5, 200.0,
             "distance in metres beyond which no landmark is found; larger values give more features");
    v.integer("most_features", most_features, 1, 100000,
              "most features of one picture; larger values give more features");
    v.integer("octaves", octaves, 1, 16,
              "levels of the image pyramid; larger values find landmarks over more distances");
    v.number("octave_factor", octave_factor, 1.01, 2.0,
             "scale factor from one level of the image pyramid to the next; larger values find landmarks over more "
             "distances");
    v.number("pixel_noise", pixel_noise, 0.0, 20.0,
             "standard deviation in pixels of a feature on the lowest level, which grows with the octave's factor; "
             "larger values are less accurate");
    v.fraction("flipped_bits", flipped_bits,
               "share of a descriptor's bits that are wrong in a frame; larger values make features harder to match");
    v.fraction("missed", missed,
               "share of visible landmarks that a frame does not find; larger values give fewer features");
    v.fraction("outliers", outliers,
               "features without a landmark, as a share of the others; larger values give more wrong ones");
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
