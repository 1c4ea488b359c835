#pragma once
// From a view to what a camera hands over. Pure functions; numbers come from the frame's own stream.

#include <mapweave/simulation/camera_options.h>
#include <mapweave/simulation/camera_recording.h>
#include <mapweave/simulation/light.h>
#include <mapweave/simulation/random.h>
#include <mapweave/simulation/renderer.h>

namespace mapweave::simulation {

// Averages the view's values along each pixel's motion during the exposure, of which the view shows the middle.
// `blurred` gives its memory.
void blur(RenderedView&, const CameraModel&, const Pose3& world_from_first, const Pose3& world_from_middle,
          const Pose3& world_from_last, std::vector<float>& blurred);

// The view in the light that falls on what each pixel shows.
void light_up(RenderedView&, const CameraModel&, const Pose3& world_from_camera, const LightOptions&);

// Light that falls on the corners, as a share of that in the middle: one per pixel, row by row.
std::vector<float> vignette(const CameraIntrinsics&, double vignetting);

Picture expose(const RenderedView&, const std::vector<float>& vignette, double gain, double noise,
               const RandomStream& numbers, std::uint64_t frame);
void measure_depth(const RenderedView&, const CameraModel&, const DepthNoiseOptions&, const RandomStream& numbers,
                   std::uint64_t frame, std::vector<std::uint16_t>& depth);

}  // namespace mapweave::simulation
