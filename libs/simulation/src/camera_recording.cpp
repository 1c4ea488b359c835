#include <mapweave/simulation/camera_recording.h>

#include "camera_noise.h"

#include <mapweave/core/error.h>

#include <algorithm>
#include <cmath>

namespace mapweave::simulation {
namespace {

constexpr double kOffsetDrift = 0.001;    // seconds per second (README: fitted)
constexpr double kExposureSeconds = 2.0;  // between the points of the brightness' wandering

// A smooth wandering with standard deviation 1 or a little less, by cubic interpolation between normal numbers.
double wandering(const RandomStream& numbers, double seconds) {
  const double at = seconds / kExposureSeconds, before = std::floor(at), t = at - before;
  const auto value = [&](double index) { return numbers.at(static_cast<std::uint64_t>(index + 1.0)).normal(); };
  const double a = value(before), b = value(before + 1.0);
  return a + (b - a) * t * t * (3.0 - 2.0 * t);
}

// When the depth is taken, since the colour was: a drift that starts anew at its far end.
double depth_offset(const DepthNoiseOptions& options, const RandomStream& numbers, double seconds) {
  const double reach = options.offset_ms * 1e-3;
  if (reach <= 0.0) return 0.0;
  const double shares = (seconds * kOffsetDrift / (2.0 * reach)) + numbers.at(0).uniform();
  return std::round((2.0 * (shares - std::floor(shares)) - 1.0) * reach * 1e6) * 1e-6;
}

}  // namespace

Pose3 CameraOptions::robot_from_body() const {
  constexpr double kRadians = M_PI / 180.0;
  return {{x_m, y_m, z_m},
          Eigen::AngleAxisd(yaw_deg * kRadians, Eigen::Vector3d::UnitZ()) *
              Eigen::AngleAxisd(pitch_deg * kRadians, Eigen::Vector3d::UnitY()) *
              Eigen::AngleAxisd(roll_deg * kRadians, Eigen::Vector3d::UnitX())};
}

Pose3 CameraOptions::robot_from_camera() const {
  return compose(robot_from_body(), {Eigen::Vector3d::Zero(), Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5)});
}

CameraRecording::CameraRecording(const World& world, std::size_t robot, std::size_t camera)
    : world_(&world),
      robot_(robot),
      options_(world.cameras(robot).at(camera)),
      model_(options_.intrinsics()),
      robot_from_camera_(options_.robot_from_camera()),
      frame_count_(static_cast<std::size_t>(world.trajectory(robot).duration_s() * options_.frames_per_second) + 1),
      vignette_(vignette(options_.intrinsics(), options_.image.vignetting)),
      seed_(static_cast<std::uint64_t>(world.options().seed)),
      owner_(world.robot_id(robot).str() + "/" + options_.id) {}

// Whole microseconds, as files of trajectories keep them.
double CameraRecording::seconds(std::size_t frame) const {
  return std::round(static_cast<double>(frame) * 1e6 / options_.frames_per_second) * 1e-6;
}

Stamp CameraRecording::stamp(std::size_t frame) const {
  return Stamp{world_->first_stamp(robot_).ns + std::llround(seconds(frame) * 1e6) * 1000};
}

Pose3 CameraRecording::world_from_camera(double seconds) const {
  return compose(world_->world_from_robot(robot_, seconds), robot_from_camera_);
}

Picture CameraRecording::take(double seconds, const Pose3& left_from_camera, double gain, const RandomStream& noise,
                              std::uint64_t frame, Workspace& workspace) const {
  RenderedView& view = workspace.view;
  std::vector<Surface> moving;
  const Scene& scene = world_->scene(world_->building_of(robot_));
  for (const Body& body : world_->bodies_around(robot_, seconds)) {
    for (Surface& surface : scene.surfaces_of(body)) moving.push_back(std::move(surface));
  }
  const auto pose = [&](double at) { return compose(world_from_camera(at), left_from_camera); };
  render(scene, moving, model_, pose(seconds), options_.colour ? Channels::colour : Channels::grey, view);
  const LightOptions& light = world_->options().light;
  light_up(view, model_, pose(seconds), light);
  const double half = 0.5e-3 * options_.image.exposure_ms * light.exposure_factor();
  const Pose3 first = pose(seconds - half), last = pose(seconds + half), motion = between(first, last);
  if (motion.t.norm() > 1e-5 || motion.q.vec().norm() > 1e-5)
    blur(view, model_, first, pose(seconds), last, workspace.blurred);
  return expose(view, vignette_, gain * light.brightness(), options_.image.noise * light.amplification(), noise, frame);
}

CameraFrame CameraRecording::frame(std::size_t frame, Workspace& workspace) const {
  MAPWEAVE_EXPECT(frame < frame_count_, "a frame of the recording");
  const double at = seconds(frame);
  const auto stream = [&](const char* purpose) { return RandomStream(seed_, purpose, owner_); };
  CameraFrame result;
  result.stamp = result.depth_stamp = stamp(frame);
  result.world_from_camera = world_from_camera(at);
  const bool is_covered = world_->is_carried(robot_, at) || options_.is_dark(at);
  const double gain = is_covered ? 0.0 : std::exp(options_.image.exposure_change * wandering(stream("exposure"), at));
  result.left = take(at, {}, gain, stream("left picture"), frame, workspace);
  if (options_.kind == SimulatedCameraKind::stereo)
    result.right = take(at, {{options_.baseline_m, 0.0, 0.0}, Eigen::Quaterniond::Identity()}, gain,
                        stream("right picture"), frame, workspace);
  if (options_.kind != SimulatedCameraKind::rgbd) return result;

  const double offset = depth_offset(options_.depth, stream("depth offset"), at);
  const RenderedView* view = &workspace.view;
  if (offset != 0.0) {
    result.depth_stamp.ns += std::llround(offset * 1e6) * 1000;
    std::vector<Surface> moving;
    const Scene& scene = world_->scene(world_->building_of(robot_));
    for (const Body& body : world_->bodies_around(robot_, at + offset)) {
      for (Surface& surface : scene.surfaces_of(body)) moving.push_back(std::move(surface));
    }
    render(scene, moving, model_, world_from_camera(at + offset), Channels::none, workspace.depth_view);
    view = &workspace.depth_view;
  }
  measure_depth(*view, model_, options_.depth, stream("depth"), frame, result.depth);
  if (is_covered) std::fill(result.depth.begin(), result.depth.end(), std::uint16_t{0});
  return result;
}

}  // namespace mapweave::simulation
