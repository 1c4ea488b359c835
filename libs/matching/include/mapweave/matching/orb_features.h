#pragma once
// ORB features of a picture, by OpenCV: what vocabularies are trained from.

#include <mapweave/matching/orb_descriptor.h>

#include <vector>

namespace mapweave::matching {

// Grey, 8 bits, row by row; not owned.
struct PictureView {
  const std::uint8_t* pixels = nullptr;
  int width = 0, height = 0;
  std::size_t row_bytes = 0;
};

struct OrbFeatureOptions {
  int features = 1000;
  int levels = 8;
  double scale = 1.2;
  int fast_threshold = 12;
  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("features", features, 10, 100000, "of one picture at most");
    v.integer("levels", levels, 1, 16, "of the pyramid");
    v.number("scale", scale, 1.05, 2.0, "between two levels of the pyramid");
    v.integer("fast_threshold", fast_threshold, 1, 100, "least step of brightness around a corner");
  }
};

struct FeaturePoint {
  float u_px = 0.0f, v_px = 0.0f;  // in the full picture; the centre of the upper left pixel is (0, 0)
  float angle_deg = 0.0f;          // of the patch, 0..360
  std::uint8_t level = 0;          // of the pyramid
};

struct OrbFeatures {
  std::vector<FeaturePoint> points;
  std::vector<OrbDescriptor> descriptors;
};

// In a canonical order: level, row, column. Safe to call from several threads.
OrbFeatures orb_features(const PictureView&, const OrbFeatureOptions& = {});

}  // namespace mapweave::matching
