#pragma once
// Features of two pictures that may show the same thing, by their descriptors.

#include <mapweave/matching/orb_features.h>

#include <vector>

namespace mapweave::matching {

// Not owned.
struct FeaturesView {
  std::size_t count = 0;
  const FeaturePoint* points = nullptr;
  const OrbDescriptor* descriptors = nullptr;
  const std::uint32_t* nodes = nullptr;    // of one vocabulary (BinaryVocabulary::describe_picture); null: unknown
  const std::uint32_t* by_node = nullptr;  // what order_by_node() says; null: it is asked for each match
};
// Numbers of features by node, then by number.
std::vector<std::uint32_t> order_by_node(const std::uint32_t* nodes, std::size_t count);
inline FeaturesView view_of(const OrbFeatures& features) {
  return {features.points.size(), features.points.data(), features.descriptors.data(), nullptr, nullptr};
}

struct FeatureMatch {
  std::uint32_t a = 0, b = 0;
  int distance = 0;
};

struct MatchingOptions {
  int max_distance = 60;
  double ratio = 0.8;
  double rotation_window_deg = 60.0;
  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("max_distance", max_distance, 1, 256,
              "most bits of 256 in which two ORB descriptors may differ to be matched; larger values give more matches "
              "and more wrong "
              "ones");
    v.fraction("ratio", ratio,
               "largest ratio of the distances to the nearest and the second nearest descriptor (Lowe's test); larger "
               "values keep more matches, 1 switches the test off");
    v.number("rotation_window_deg", rotation_window_deg, 0.0, 360.0,
             "width in degrees of the window around the commonest rotation of matched features, outside of which "
             "matches are dropped; larger values keep more matches, 360 switches the test off");
  }
};

// Pairs that are each other's nearest, and clearly so; by rising `a`. Where both sides know nodes, only features of one
// node are compared (the direct index of Galvez-Lopez and Tardos): faster, and fewer are found. Exchanging a and b
// exchanges the answers.
std::vector<FeatureMatch> match_features(const FeaturesView& a, const FeaturesView& b,
                                         const MatchingOptions& options = {});

// The matches whose patches turned by about the angle by which most did. Fewer than eight matches give no such angle:
// then all.
std::vector<FeatureMatch> turning_alike(const FeaturesView& a, const FeaturesView& b, std::vector<FeatureMatch> matches,
                                        double window_deg);

}  // namespace mapweave::matching
