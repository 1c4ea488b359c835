#pragma once
// How landmarks of a map are known again: cameras follow corners by what surrounds them, maps keep features with
// descriptors. A landmark takes the descriptor of a feature beside it.

#include <mapweave/maps/map.h>
#include <mapweave/maps/node_numbers.h>
#include <mapweave/matching/landmark_index.h>

namespace mapweave::matching {

struct DescriptionOptions {
  double reach_px = 3.0;
  double sigma_px = 0.7;
  double sigma_m = 0.01;
  int most_views = 8;
  template <class Visitor>
  void describe(Visitor& v) {
    v.positive(
        "reach_px", reach_px,
        "longest distance in pixels, on the feature's pyramid level, from a projected landmark to the ORB feature that "
        "gives it its descriptor; larger values describe more landmarks, some by a feature beside them");
    v.positive("sigma_px", sigma_px,
               "standard deviation in pixels of where a landmark is seen in one picture; times its distance it gives "
               "the landmark's position error; larger values trust shared landmarks less");
    v.positive("sigma_m", sigma_m,
               "least standard deviation in metres that a shared landmark is given, however often it was seen; larger "
               "values trust shared landmarks less");
    v.integer("most_views", most_views, 1, 1000,
              "number of keyframes, the latest first, whose features are considered when a landmark gets its "
              "descriptor; larger values look at more views and take longer");
  }
};

// const calls are thread-safe.
class LandmarkDescriber {
 public:
  explicit LandmarkDescriber(const Map& map, const DescriptionOptions& options = {});  // the map outlives it, unchanged
  // In the map's frame; of the features beside it in the keyframes that see it, the one that the others resemble most
  // (CVS III-B: location, observations and descriptor). updated_by: the client of the latest keyframe that sees it.
  // nullopt where no keyframe has a feature there, or its anchor or point is none.
  std::optional<DescribedLandmark> described(const Landmark& landmark) const;

 private:
  struct Known {
    const Node* node;
    const KeyframeFeatures* keyframe;  // null: the node is none
    Pose3 map_from_camera, camera_from_map;
    std::vector<std::uint32_t> begin, by_row;  // its points, in rows; where each row begins, and the end
    std::vector<double> per_px2;               // of each level: what a square of a pixel is of one on it
    int far = 0;                               // a feature that stands for a landmark is nearer, in units of its points
  };
  struct Look;
  void sort_by_row(Known& known) const;
  Look look(const Known& known, const LandmarkSighting& sighting, double depth_m) const;

  DescriptionOptions options_;
  NodeNumbers numbers_;
  std::vector<Known> nodes_;
};

}  // namespace mapweave::matching
