#include "camera_world.h"

#include <mapweave/core/error.h>
#include <mapweave/simulation/camera_recording.h>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>

namespace mapweave::simulation {
namespace {

using test::built;
using test::camera_world;
using test::perfect;
using test::tiny_camera;

CameraFrame frame_of(const World& world, std::size_t number, std::size_t camera = 0) {
  CameraRecording::Workspace workspace;
  return CameraRecording(world, 0, camera).frame(number, workspace);
}

double mean_of(const std::vector<std::uint8_t>& values) {
  double sum = 0.0;
  for (const int value : values) sum += value;
  return sum / static_cast<double>(values.size());
}

double depth_at(const CameraFrame& frame, int column, int row) {
  return frame.depth[static_cast<std::size_t>(row * 160 + column)] * kDepthUnit;
}

TEST(CameraRecording, measures_the_distance_of_the_wall_ahead) {
  const World world = built(camera_world(perfect(tiny_camera(SimulatedCameraKind::rgbd))));
  const CameraFrame frame = frame_of(world, 0);
  EXPECT_NEAR(depth_at(frame, 80, 60), 6.0 - 1.0 - 0.15, 0.005);
  EXPECT_EQ(frame.left.channels, 1);
  EXPECT_EQ(frame.left.values.size(), 160u * 120u);
}

TEST(CameraRecording, keeps_the_worlds_clock_and_writes_the_truth) {
  WorldOptions options = camera_world(tiny_camera(SimulatedCameraKind::mono));
  options.robots[0].start_s = 2.0;
  options.cameras[0].yaw_deg = 90.0;
  const World world = built(options);
  const CameraRecording recording(world, 0, 0);
  EXPECT_EQ(recording.stamp(0), Recording(world, 0).next()->stamp);
  EXPECT_DOUBLE_EQ(seconds_between(recording.stamp(0), recording.stamp(7)), 0.7);
  const CameraFrame frame = frame_of(world, 20);
  const Pose2 robot = world.trajectory(0).at(2.0);
  EXPECT_NEAR(frame.world_from_camera.t.x(), robot.x + 0.15, 1e-9);
  EXPECT_NEAR(frame.world_from_camera.t.z(), 0.6, 1e-9);
  const Eigen::Vector3d axis = frame.world_from_camera.q * Eigen::Vector3d::UnitZ(),
                        down = frame.world_from_camera.q * Eigen::Vector3d::UnitY();
  EXPECT_NEAR(axis.y(), 1.0, 1e-9) << "a camera turned to the left looks along y";
  EXPECT_NEAR(down.z(), -1.0, 1e-9);
}

TEST(CameraRecording, makes_the_same_frame_in_any_order_and_another_for_another_seed) {
  WorldOptions options = camera_world(tiny_camera(SimulatedCameraKind::rgbd));
  const World world = built(options);
  const CameraRecording recording(world, 0, 0);
  CameraRecording::Workspace workspace;
  const CameraFrame third = recording.frame(3, workspace);
  recording.frame(5, workspace);
  const CameraFrame again = recording.frame(3, workspace);
  EXPECT_EQ(again.left.values, third.left.values);
  EXPECT_EQ(again.depth, third.depth);
  options.buildings[0].seed = 8;
  const CameraFrame one = frame_of(built(options), 3);
  options.seed = 9;
  EXPECT_NE(frame_of(built(options), 3).left.values, one.left.values) << "the same building, but other noise";
}

TEST(CameraRecording, sees_the_left_picture_shifted_by_the_disparity_in_the_right_one) {
  CameraOptions camera = perfect(tiny_camera(SimulatedCameraKind::stereo));
  camera.baseline_m = 4.85 / 131.0 * 10.0;  // ten pixels at the wall ahead
  const World world = built(camera_world(camera));
  const CameraFrame frame = frame_of(world, 0);
  double shifted = 0.0, unshifted = 0.0;
  for (int row = 56; row < 64; ++row) {  // the wall at the end fills the middle: 2 m are 54 pixels
    for (int column = 75; column < 95; ++column) {
      const auto at = [&](const Picture& picture, int u) {
        return static_cast<int>(picture.values[static_cast<std::size_t>(row * 160 + u)]);
      };
      shifted += std::abs(at(frame.left, column) - at(frame.right, column - 10));
      unshifted += std::abs(at(frame.left, column) - at(frame.right, column));
    }
  }
  EXPECT_LT(shifted / 160.0, 1.5);
  EXPECT_GT(unshifted / 160.0, 4.0 * shifted / 160.0);
}

TEST(CameraRecording, falsifies_depths_as_the_options_say) {
  CameraOptions camera = perfect(tiny_camera(SimulatedCameraKind::rgbd));
  const World clean_world = built(camera_world(camera));
  camera.depth.noise_m = 0.002;
  camera.depth.noise_per_m2 = 0.001;
  const World world = built(camera_world(camera));
  const CameraFrame clean = frame_of(clean_world, 0), noisy = frame_of(world, 0);
  double near_squares = 0.0, far_squares = 0.0, sum = 0.0;
  int near_count = 0, far_count = 0;
  for (std::size_t i = 0; i < clean.depth.size(); ++i) {
    const double z = clean.depth[i] * kDepthUnit, error = noisy.depth[i] * kDepthUnit - z;
    const bool is_near = z<1.5, is_far = z> 4.5;
    sum += error / (0.002 + 0.001 * z * z);
    if (is_near) {
      near_squares += error * error / std::pow(0.002 + 0.001 * z * z, 2);
      ++near_count;
    }
    if (is_far) {
      far_squares += error * error / std::pow(0.002 + 0.001 * z * z, 2);
      ++far_count;
    }
  }
  ASSERT_GT(near_count, 300);
  ASSERT_GT(far_count, 300);
  EXPECT_NEAR(std::sqrt(near_squares / near_count), 1.0, 0.1);
  EXPECT_NEAR(std::sqrt(far_squares / far_count), 1.0, 0.12);
  EXPECT_NEAR(sum / static_cast<double>(clean.depth.size()), 0.0, 0.05);
}

TEST(CameraRecording, measures_in_steps_of_disparity) {
  CameraOptions camera = perfect(tiny_camera(SimulatedCameraKind::rgbd));
  camera.depth.step_per_m2 = 0.0028;
  const World world = built(camera_world(camera));
  for (const std::uint16_t depth : frame_of(world, 0).depth) {
    if (depth == 0) continue;
    const double steps = 1.0 / (0.0028 * depth * kDepthUnit);
    EXPECT_NEAR(steps, std::round(steps), steps * steps * 0.0028 * 0.6 * kDepthUnit + 1e-6) << depth;
  }
}

TEST(CameraRecording, has_holes_out_of_range_at_grazing_surfaces_and_in_the_projectors_shadow) {
  const CameraOptions clean = perfect(tiny_camera(SimulatedCameraKind::rgbd));
  const auto holes = [](const CameraOptions& camera) {
    WorldOptions options = camera_world(camera);
    options.buildings[0].corridor.clutter = 6;
    options.buildings[0].corridor.width_m = 3.0;
    const World world = built(options);
    const auto depth = frame_of(world, 0).depth;
    return std::count(depth.begin(), depth.end(), 0);
  };
  EXPECT_EQ(holes(clean), 0);
  CameraOptions camera = clean;
  camera.depth.max_range_m = 3.0;
  EXPECT_GT(holes(camera), 1000) << "the wall at the end";
  camera = clean;
  camera.depth.grazing_deg = 70.0;
  EXPECT_GT(holes(camera), 500) << "the walls beside";
  camera = clean;
  camera.depth.shadow_m = 0.3;
  EXPECT_GT(holes(camera), 50) << "beside the boxes";
  camera = clean;
  camera.depth.dropouts = 0.1;
  EXPECT_NEAR(holes(camera), 1920, 200);
}

TEST(CameraRecording, falsifies_grey_levels_as_the_options_say) {
  CameraOptions camera = perfect(tiny_camera(SimulatedCameraKind::mono));
  const World clean_world = built(camera_world(camera));
  camera.image.noise = 3.0;
  const World world = built(camera_world(camera));
  const CameraFrame clean = frame_of(clean_world, 0), noisy = frame_of(world, 0);
  double sum = 0.0, squares = 0.0;
  int count = 0;
  for (std::size_t i = 0; i < clean.left.values.size(); ++i) {
    const int value = clean.left.values[i];
    if (value < 15 || value > 240) continue;
    const double error = static_cast<double>(noisy.left.values[i]) - value;
    sum += error;
    squares += error * error;
    ++count;
  }
  EXPECT_NEAR(sum / count, 0.0, 0.1);
  EXPECT_NEAR(std::sqrt(squares / count), 3.0, 0.15);
}

TEST(CameraRecording, darkens_corners_and_wanders_in_brightness) {
  CameraOptions camera = perfect(tiny_camera(SimulatedCameraKind::mono));
  const World clean_world = built(camera_world(camera));
  const CameraFrame clean = frame_of(clean_world, 0);
  camera.image.vignetting = 0.5;
  const CameraFrame vignetted = frame_of(built(camera_world(camera)), 0);
  EXPECT_NEAR(vignetted.left.values[0], 0.5 * clean.left.values[0], 1.5);
  EXPECT_NEAR(vignetted.left.values[60 * 160 + 80], clean.left.values[60 * 160 + 80], 1.0);
  camera.image.vignetting = 0.0;
  camera.image.exposure_change = 0.2;
  const World changing = built(camera_world(camera));
  double least = 10.0, greatest = 0.0;
  for (std::size_t i = 0; i < 60; i += 10) {
    const double ratio = mean_of(frame_of(changing, i).left.values) / mean_of(frame_of(clean_world, i).left.values);
    least = std::min(least, ratio);
    greatest = std::max(greatest, ratio);
  }
  EXPECT_GT(greatest / least, 1.1);
  EXPECT_LT(greatest / least, 3.0);
}

TEST(CameraRecording, exposes_longer_and_amplifies_at_night) {
  WorldOptions options = camera_world(perfect(tiny_camera(SimulatedCameraKind::rgbd)));
  options.cameras[0].image.noise = 1.0;
  const CameraFrame day = frame_of(built(options), 0);
  const auto noise_and_brightness = [&](double level) {
    options.light.level = level;
    const CameraFrame frame = frame_of(built(options), 0);
    EXPECT_EQ(frame.depth, day.depth) << "a depth camera brings its own light";
    double squares = 0.0, sum = 0.0, day_sum = 0.0;
    int count = 0;
    for (std::size_t i = 0; i < frame.left.values.size(); ++i) {
      const int value = frame.left.values[i], by_day = day.left.values[i];
      if (by_day < 60 || by_day > 195) continue;
      sum += value;
      day_sum += by_day;
      squares += (value - by_day) * (value - by_day);
      ++count;
    }
    return std::pair(std::sqrt(squares / count), sum / day_sum);
  };
  EXPECT_EQ(noise_and_brightness(1.0), std::pair(0.0, 1.0));
  const auto [dusk_noise, dusk] = noise_and_brightness(0.4);  // a longer exposure is enough
  EXPECT_EQ(dusk_noise, 0.0);
  EXPECT_EQ(dusk, 1.0);
  const auto [night_noise, night] = noise_and_brightness(1.0 / 15.0);  // 3 times as long, amplified 5 times
  EXPECT_NEAR(night_noise, 4.0, 0.5) << "the same numbers, 5 times as large";
  EXPECT_NEAR(night, 1.0, 0.02);
  EXPECT_NEAR(noise_and_brightness(1.0 / 48.0).second, 0.5, 0.03) << "more than 8 times is not amplified";
}

TEST(CameraRecording, is_blurred_more_at_night) {
  WorldOptions options = camera_world(perfect(tiny_camera(SimulatedCameraKind::mono)));
  options.cameras[0].image.exposure_ms = 30.0;
  options.cameras[0].yaw_deg = 90.0;  // the wall beside goes by
  const auto roughness = [&] {
    const Picture picture = frame_of(built(options), 20).left;
    double sum = 0.0;
    for (std::size_t i = 1; i < picture.values.size(); ++i)
      if (i % 160 != 0) sum += std::abs(picture.values[i] - picture.values[i - 1]);
    return sum;
  };
  const double by_day = roughness();
  options.light.level = 1.0 / 3.0;
  EXPECT_LT(roughness(), 0.9 * by_day);
}

TEST(CameraRecording, is_bright_beneath_lamps_and_dark_between) {
  WorldOptions options = camera_world(perfect(tiny_camera(SimulatedCameraKind::rgbd)));
  const World by_day = built(options);
  options.light.lamps = 0.8;
  options.light.lamp_spacing_m = 3.0;
  const World by_night = built(options);
  const CameraFrame day = frame_of(by_day, 0), night = frame_of(by_night, 0);
  EXPECT_EQ(night.depth, day.depth);
  const CameraRecording recording(by_night, 0, 0);
  const CameraModel camera(by_night.cameras(0)[0].intrinsics());
  int compared = 0;
  double least = 1.0, greatest = 0.0;
  for (int row = 2; row < 120; row += 4) {
    for (int column = 2; column < 160; column += 4) {
      const auto at = static_cast<std::size_t>(row * 160 + column);
      const double z = night.depth[at] * kDepthUnit;
      const int by_day_level = day.left.values[at];
      if (z <= 0.0 || by_day_level < 60 || by_day_level > 250) continue;
      const Eigen::Vector2d ray = camera.normalised(column, row);
      const double share =
          options.light.share_at(transformed(Eigen::Vector3d(ray.x() * z, ray.y() * z, z), night.world_from_camera));
      EXPECT_NEAR(night.left.values[at], share * by_day_level, 2.0) << row << ", " << column;
      least = std::min(least, share);
      greatest = std::max(greatest, share);
      ++compared;
    }
  }
  EXPECT_GT(compared, 100);
  EXPECT_LT(least, 0.35);
  EXPECT_GT(greatest, 0.8);
}

TEST(CameraRecording, blurs_what_moves_while_it_is_exposed) {
  CameraOptions camera = perfect(tiny_camera(SimulatedCameraKind::mono));
  WorldOptions options = camera_world(camera);
  options.robots[0].waypoints = {{1.0, 1.0}, {4.0, 1.0}, {1.0, 1.0}};  // turns about at the end
  const auto roughness = [&](double exposure_ms, std::size_t frame_number) {
    options.cameras[0].image.exposure_ms = exposure_ms;
    const World world = built(options);
    const Picture picture = frame_of(world, frame_number).left;
    double sum = 0.0;
    for (std::size_t i = 1; i < picture.values.size(); ++i) {
      if (i % 160 != 0) sum += std::abs(picture.values[i] - picture.values[i - 1]);
    }
    return sum;
  };
  const World world = built(options);
  std::size_t turning = 0, standing = 0;
  for (std::size_t i = 1; i < CameraRecording(world, 0, 0).frame_count(); ++i) {
    if (std::abs(wrap_angle(world.trajectory(0).at(0.1 * static_cast<double>(i) + 0.05).phi -
                            world.trajectory(0).at(0.1 * static_cast<double>(i) - 0.05).phi)) > 0.06)
      turning = i;
  }
  ASSERT_GT(turning, 0u);
  EXPECT_LT(roughness(50.0, turning), 0.8 * roughness(0.0, turning));
  EXPECT_NEAR(roughness(50.0, standing) / roughness(0.0, standing), 1.0, 0.05);
}

TEST(CameraRecording, takes_the_depth_before_or_after_the_colour_and_says_when) {
  CameraOptions camera = perfect(tiny_camera(SimulatedCameraKind::rgbd));
  camera.depth.offset_ms = 20.0;
  const World world = built(camera_world(camera));
  const CameraRecording recording(world, 0, 0);
  CameraRecording::Workspace workspace;
  double greatest = 0.0;
  for (std::size_t i = 10; i < 60; i += 5) {
    const CameraFrame frame = recording.frame(i, workspace);
    const double offset = seconds_between(frame.stamp, frame.depth_stamp);
    EXPECT_LE(std::abs(offset), 0.020001);
    greatest = std::max(greatest, std::abs(offset));
    const double true_depth =
        6.0 - recording.world_from_camera(seconds_between(world.first_stamp(0), frame.depth_stamp)).t.x();
    EXPECT_NEAR(depth_at(frame, 80, 60), true_depth, 0.0055);
  }
  EXPECT_GT(greatest, 0.0);
}

TEST(CameraRecording, shows_others_walking_by) {
  WorldOptions options = camera_world(perfect(tiny_camera(SimulatedCameraKind::rgbd)));
  options.robots.resize(2);
  options.robots[1] = options.robots[0];
  options.robots[1].id = "beta";
  options.robots[1].waypoints = {{3.0, 1.0}, {4.5, 1.0}};
  const double before = depth_at(frame_of(built(options), 0), 80, 100);
  EXPECT_NEAR(before, 3.0 - 0.2 - 1.15, 0.02) << "below half a metre, beta stands in the way";
  EXPECT_GT(depth_at(frame_of(built(options), 0), 80, 60), 4.5) << "and is lower than the camera";
  options.people.count = 3;
  EXPECT_NE(frame_of(built(options), 30).left.values,
            frame_of(built(camera_world(options.cameras[0])), 30).left.values);
}

TEST(CameraRecording, is_black_while_it_is_covered_and_the_robot_drives_on) {
  CameraOptions camera = perfect(tiny_camera(SimulatedCameraKind::rgbd));
  camera.dark_from_s = 0.5;
  camera.dark_for_s = 1.0;
  const World world = built(camera_world(camera));
  const CameraRecording recording(world, 0, 0);
  CameraRecording::Workspace workspace;
  for (std::size_t i = 0; i < recording.frame_count() && i < 20; ++i) {
    const double seconds = static_cast<double>(i) / camera.frames_per_second;
    EXPECT_EQ(mean_of(recording.frame(i, workspace).left.values) == 0.0, seconds >= 0.5 && seconds < 1.5) << seconds;
  }
}

TEST(CameraRecording, is_black_while_the_robot_is_carried_and_elsewhere_after) {
  WorldOptions options = camera_world(perfect(tiny_camera(SimulatedCameraKind::rgbd)));
  options.robots[0].kidnappings.resize(1);
  options.robots[0].kidnappings[0] = {1.0, 1.2, 4.0};
  const World world = built(options);
  const CameraRecording recording(world, 0, 0);
  CameraRecording::Workspace workspace;
  int dark = 0;
  double last_x = recording.frame(0, workspace).world_from_camera.t.x(), greatest_step = 0.0;
  for (std::size_t i = 0; i < recording.frame_count(); ++i) {
    const CameraFrame frame = recording.frame(i, workspace);
    if (mean_of(frame.left.values) == 0.0) {
      ++dark;
      EXPECT_EQ(std::count(frame.depth.begin(), frame.depth.end(), 0), 160 * 120);
      continue;
    }
    greatest_step = std::max(greatest_step, frame.world_from_camera.t.x() - last_x);
    last_x = frame.world_from_camera.t.x();
  }
  EXPECT_NEAR(dark, 40, 1);
  EXPECT_NEAR(greatest_step, 1.2, 0.25);
  // The wheels knew nothing of it, and the laser saw nothing.
  Recording odometry(world, 0);
  double blind = 0.0, wheels = 0.0;
  while (const auto step = odometry.next()) {
    wheels = step->odometry_from_robot.x;
    if (!step->ranges.empty() && *std::max_element(step->ranges.begin(), step->ranges.end()) == 0.0f) ++blind;
  }
  EXPECT_NEAR(blind, 20, 1);
  EXPECT_NEAR(wheels, 3.0 - 1.2, 0.25);
}

TEST(CameraRecording, jumps_between_two_frames_where_carrying_takes_no_time) {
  WorldOptions options = camera_world(perfect(tiny_camera(SimulatedCameraKind::mono)));
  options.robots[0].kidnappings.resize(1);
  options.robots[0].kidnappings[0] = {1.0, 1.2, 0.0};
  const World world = built(options);
  const CameraRecording recording(world, 0, 0);
  int jumps = 0;
  for (double t = 0.1; t < world.trajectory(0).duration_s(); t += 0.1)
    jumps += (recording.world_from_camera(t).t - recording.world_from_camera(t - 0.1).t).norm() > 1.0;
  EXPECT_EQ(jumps, 1);
  CameraRecording::Workspace workspace;
  for (std::size_t i = 0; i < recording.frame_count(); i += 3)
    EXPECT_GT(mean_of(recording.frame(i, workspace).left.values), 20.0);
}

TEST(CameraRecording, takes_a_robots_own_cameras_for_the_worlds) {
  WorldOptions options = camera_world(tiny_camera(SimulatedCameraKind::mono));
  options.robots[0].cameras = {tiny_camera(SimulatedCameraKind::stereo), tiny_camera(SimulatedCameraKind::rgbd)};
  options.robots[0].cameras[1].id = "back";
  options.robots.resize(2, options.robots[0]);
  options.robots[1].id = "beta";
  options.robots[1].cameras.clear();
  const World world = built(options);
  ASSERT_EQ(world.cameras(0).size(), 2u);
  EXPECT_EQ(world.cameras(0)[1].id, "back");
  ASSERT_EQ(world.cameras(1).size(), 1u);
  EXPECT_EQ(world.cameras(1)[0].kind, SimulatedCameraKind::mono);
}

TEST(CameraRecording, leans_with_the_floor) {
  WorldOptions options = camera_world(tiny_camera(SimulatedCameraKind::mono));
  options.motion.floor_tilt_deg = 1.0;
  const World world = built(options);
  double squares = 0.0;
  int count = 0;
  for (double t = 0.0; t < world.trajectory(0).duration_s(); t += 0.05) {
    const Pose3 pose = world.world_from_robot(0, t);
    const Eigen::Vector3d up = pose.q * Eigen::Vector3d::UnitZ();
    squares += up.x() * up.x();
    ++count;
    EXPECT_NEAR(pose.t.x(), world.trajectory(0).at(t).x, 1e-12);
  }
  EXPECT_NEAR(std::sqrt(squares / count) * 180.0 / M_PI, 1.0, 0.6);
}

TEST(CameraRecording, refuses_cameras_that_cannot_be) {
  const auto message = [](const WorldOptions& options) -> std::string {
    try {
      built(options);
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kBadInput);
      return error.what();
    }
    return "";
  };
  WorldOptions options = camera_world(tiny_camera(SimulatedCameraKind::mono));
  options.cameras.push_back(options.cameras[0]);
  EXPECT_THAT(message(options), testing::HasSubstr("two cameras have the id 'camera'"));
  options.cameras.pop_back();
  options.cameras[0].id = "../camera";
  EXPECT_THAT(message(options), testing::HasSubstr("cannot be a camera's id"));
  options.cameras[0].id = "camera";
  options.cameras[0].k1 = -3.0;
  EXPECT_THAT(message(options), testing::HasSubstr("distortion"));
  options.cameras[0].k1 = 0.0;
  options.cameras[0].depth.min_range_m = 2.0;
  options.cameras[0].depth.max_range_m = 1.0;
  EXPECT_THAT(message(options), testing::HasSubstr("depth"));
}

}  // namespace
}  // namespace mapweave::simulation
