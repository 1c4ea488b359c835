#pragma once
// What a camera sees of a scene, without noise. Surfaces are cut out tile by tile in normalised coordinates, where both
// a surface's rim and its inverse depth are linear (so that distortion costs a table and nothing else); then every
// pixel is looked up once in the texture of the surface that it shows: between levels (Williams: Pyramidal parametrics,
// SIGGRAPH 1983), with up to four samples along the longer axis of its footprint, and four samples per pixel where
// surfaces meet.

#include <mapweave/simulation/camera_model.h>
#include <mapweave/simulation/scene.h>

#include <vector>

namespace mapweave::simulation {

enum class Channels { none, grey, colour };

// A picture before anything was lost. Rows are padded to the camera's stride.
struct RenderedView {
  int width = 0, height = 0, stride = 0;
  std::vector<float> inverse_depth;   // 1/z, 1/metres; 0: nothing there
  std::vector<std::int32_t> surface;  // of each pixel, into `surfaces`; -1: nothing
  // As the camera sees them, for every pixel p = (x, y, 1), normalised: 1/z = inverse_depth . p
  struct Shown {
    std::int32_t number;  // in the scene; those that move follow the scene's
    Eigen::Vector3f inverse_depth;
  };
  std::vector<Shown> surfaces;
  int channels = 0;           // 0, 1 (grey) or 3 (red, green, blue)
  std::vector<float> values;  // 0 to 255, channel by channel within a pixel

  std::size_t at(int row, int column) const {
    return static_cast<std::size_t>(row) * static_cast<std::size_t>(stride) + static_cast<std::size_t>(column);
  }
  double depth(int row, int column) const {  // metres along the camera's axis; infinite where nothing is
    return 1.0 / static_cast<double>(inverse_depth[at(row, column)]);
  }
};

// A pure function; `view` is filled anew; its memory is used again. `moving` comes on top of the scene.
void render(const Scene&, const std::vector<Surface>& moving, const CameraModel&, const Pose3& world_from_camera,
            Channels, RenderedView& view);

}  // namespace mapweave::simulation
