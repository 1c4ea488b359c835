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
    v.integer("features", features, 10, 100000,
              "most ORB features of one picture; larger values give more features and are slower");
    v.integer("levels", levels, 1, 16, "levels of the image pyramid; larger values find features that look larger");
    v.number("scale", scale, 1.05, 2.0,
             "scale factor from one level of the image pyramid to the next; larger values find features that look "
             "larger, in coarser steps");
    v.integer("fast_threshold", fast_threshold, 1, 100,
              "least difference in grey levels between a corner and the pixels around it (FAST); larger values find "
              "fewer corners");
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
