#pragma once
// What a world file says about cameras. The defaults of the noise were fitted to the TUM RGB-D sequence freiburg1_rpy
// (README).

#include <mapweave/simulation/camera_model.h>

#include <string>

namespace mapweave::simulation {

enum class SimulatedCameraKind { mono, stereo, rgbd };

struct ImageNoiseOptions {
  double exposure_ms = 10.0;
  double exposure_change = 0.08;
  double vignetting = 0.1;
  double noise = 1.2;
  template <class Visitor>
  void describe(Visitor& v) {
    v.number(
        "exposure_ms", exposure_ms, 0.0, 100.0,
        "exposure time of a picture in milliseconds, whose middle is the stamp; larger values blur more of what moves");
    v.number("exposure_change", exposure_change, 0.0, 1.0,
             "standard deviation of a picture's brightness as a share of it, which wanders within seconds; larger "
             "values change it more");
    v.number("vignetting", vignetting, 0.0, 0.9,
             "share by which a picture's corners are darker than its middle; larger values make them darker");
    v.number("noise", noise, 0.0, 50.0,
             "standard deviation of each channel of a pixel, in grey levels; larger values give noisier pictures");
  }
};

struct DepthNoiseOptions {
  double noise_m = 0.0002;
  double noise_per_m2 = 0.0011;
  double step_per_m2 = 0.0028;
  double min_range_m = 0.5;
  double max_range_m = 5.0;
  double grazing_deg = 80.0;
  double shadow_m = 0.075;
  double dropouts = 0.005;
  double offset_ms = 0.0;
  template <class Visitor>
  void describe(Visitor& v) {
    v.number("noise_m", noise_m, 0.0, 1.0,
             "constant part, in metres, of a depth's standard deviation, before depths are rounded to steps; larger "
             "values give noisier depths");
    v.number("noise_per_m2", noise_per_m2, 0.0, 0.1,
             "growth of a depth's standard deviation with the square of the depth, in metres per square metre; "
             "neighbouring pixels share the noise of 3 x 3; larger values give noisier depths far away");
    v.number("step_per_m2", step_per_m2, 0.0, 0.1,
             "step to which depths are rounded, which grows with the square of the depth, as whole steps of disparity "
             "do, in metres per square metre; larger values give coarser depths; 0: no rounding");
    v.number("min_range_m", min_range_m, 0.0, 5.0,
             "depth in metres below which a depth camera measures nothing; larger values measure fewer pixels");
    v.number("max_range_m", max_range_m, 0.5, 13.0,
             "depth in metres beyond which a depth camera measures nothing; larger values measure more pixels");
    v.number("grazing_deg", grazing_deg, 45.0, 90.0,
             "angle in degrees by which a surface may be turned away from the line of sight for its depth to be "
             "measured; larger values measure more pixels");
    v.number("shadow_m", shadow_m, 0.0, 0.5,
             "distance in metres from the camera to the depth sensor's projector at its right; where no light of it "
             "falls there is no depth; larger values make wider shadows; 0: no shadows");
    v.fraction("dropouts", dropouts,
               "share of pixels that have no depth, at random; larger values measure fewer pixels");
    v.number(
        "offset_ms", offset_ms, 0.0, 20.0,
        "largest time in milliseconds from the colour picture to its depth picture, before or after; it drifts by 1 "
        "ms/s; a TUM folder has the depth's own stamp, a rawlog cannot; larger values fit depths to the colour worse");
  }
};

struct CameraOptions {
  std::string id = "camera";
  SimulatedCameraKind kind = SimulatedCameraKind::rgbd;
  int width = 640;
  int height = 480;
  double fx = 525.0;
  double fy = 525.0;
  double cx = -1.0;
  double cy = -1.0;
  double k1 = 0.0, k2 = 0.0, p1 = 0.0, p2 = 0.0, k3 = 0.0;
  double frames_per_second = 15.0;
  bool colour = false;
  double x_m = 0.15, y_m = 0.0, z_m = 0.6;
  double yaw_deg = 0.0, pitch_deg = 0.0, roll_deg = 0.0;
  double baseline_m = 0.12;
  double dark_from_s = 0.0, dark_for_s = 0.0;
  ImageNoiseOptions image;
  DepthNoiseOptions depth;
  template <class Visitor>
  void describe(Visitor& v) {
    v.text("id", id, "name of the camera, which is the sensor label of its observations");
    v.choice("kind", kind,
             {{"mono", SimulatedCameraKind::mono},
              {"stereo", SimulatedCameraKind::stereo},
              {"rgbd", SimulatedCameraKind::rgbd}},
             "kind of the camera; mono: one picture; stereo: a left and a right picture; rgbd: a picture with a depth "
             "for each pixel");
    v.integer("width", width, 16, 4096, "width of a picture in pixels");
    v.integer("height", height, 16, 4096, "height of a picture in pixels");
    v.number("fx", fx, 1.0, 100000.0, "focal length along a row, in pixels; larger values narrow the view");
    v.number("fy", fy, 1.0, 100000.0, "focal length along a column, in pixels; larger values narrow the view");
    v.number("cx", cx, -1.0, 4096.0, "column of the principal point, in pixels; -1: the picture's middle");
    v.number("cy", cy, -1.0, 4096.0, "row of the principal point, in pixels; -1: the picture's middle");
    v.number("k1", k1, -10.0, 10.0, "first coefficient of radial distortion (k1)");
    v.number("k2", k2, -10.0, 10.0, "second coefficient of radial distortion (k2)");
    v.number("p1", p1, -1.0, 1.0, "first coefficient of tangential distortion (p1)");
    v.number("p2", p2, -1.0, 1.0, "second coefficient of tangential distortion (p2)");
    v.number("k3", k3, -10.0, 10.0, "third coefficient of radial distortion (k3)");
    v.number("frames_per_second", frames_per_second, 0.1, 200.0,
             "frames per second, the first one at the robot's start; larger values take more pictures");
    v.flag("colour", colour, "take colour pictures; false: grey ones");
    v.number("x_m", x_m, -5.0, 5.0,
             "distance in metres of the camera (stereo: the left one) ahead of the robot's origin");
    v.number("y_m", y_m, -5.0, 5.0,
             "distance in metres of the camera (stereo: the left one) to the left of the robot's origin");
    v.number("z_m", z_m, 0.01, 5.0, "height in metres of the camera above the floor");
    v.number("yaw_deg", yaw_deg, -180.0, 180.0,
             "angle in degrees by which the camera is turned counter-clockwise from straight ahead");
    v.number("pitch_deg", pitch_deg, -90.0, 90.0, "angle in degrees by which the camera is tipped down");
    v.number("roll_deg", roll_deg, -180.0, 180.0,
             "angle in degrees by which the camera is turned clockwise about its optical axis");
    v.number("baseline_m", baseline_m, 0.001, 5.0,
             "distance in metres from the left to the right camera (kind: stereo); larger values measure farther");
    v.number("dark_from_s", dark_from_s, 0.0, 100000.0,
             "time in seconds after the robot's start from which the camera is covered, for dark_for_s; larger values "
             "cover it later");
    v.number("dark_for_s", dark_for_s, 0.0, 100000.0,
             "time in seconds for which the camera is covered, from dark_from_s on, while the robot drives on; larger "
             "values cover it longer; 0: never");
    v.section("image", image, "errors of pictures");
    v.section("depth", depth, "errors of measured depths (kind: rgbd)");
  }
  bool is_dark(double seconds) const { return seconds >= dark_from_s && seconds < dark_from_s + dark_for_s; }
  CameraIntrinsics intrinsics() const {
    return {width,
            height,
            fx,
            fy,
            cx < 0.0 ? 0.5 * (width - 1) : cx,
            cy < 0.0 ? 0.5 * (height - 1) : cy,
            {k1, k2, p1, p2, k3}};
  }
  Pose3 robot_from_body() const;    // x ahead, z up
  Pose3 robot_from_camera() const;  // the same camera, z ahead and y down
};

struct ImuOptions {
  double readings_per_second = 0.0;
  double gyro_noise = 1.7e-4, gyro_walk = 1.9e-5;
  double accelerometer_noise = 2.0e-3, accelerometer_walk = 3.0e-3;
  double gyro_bias = 0.01, accelerometer_bias = 0.05;
  double gyro_scale = 1.0;
  template <class Visitor>
  void describe(Visitor& v) {
    v.number("readings_per_second", readings_per_second, 0.0, 1000.0,
             "readings of the inertial unit per second; 0: robots have no inertial unit");
    v.number("gyro_noise", gyro_noise, 0.0, 1.0,
             "noise density of the turn rate in rad/s/sqrt(Hz), by default an ADIS16448's; larger values give noisier "
             "turn rates");
    v.number("gyro_walk", gyro_walk, 0.0, 1.0,
             "random walk of the turn rate's bias in rad/s^2/sqrt(Hz), by default an ADIS16448's; larger values let "
             "the bias change faster");
    v.number("accelerometer_noise", accelerometer_noise, 0.0, 1.0,
             "noise density of the acceleration in m/s^2/sqrt(Hz), by default an ADIS16448's; larger values give "
             "noisier accelerations");
    v.number("accelerometer_walk", accelerometer_walk, 0.0, 1.0,
             "random walk of the acceleration's bias in m/s^3/sqrt(Hz), by default an ADIS16448's; larger values let "
             "the bias change faster");
    v.number("gyro_bias", gyro_bias, 0.0, 1.0,
             "standard deviation, at the start, of the turn rate's bias about each axis, in rad/s; larger values "
             "measure wrong turns");
    v.number("gyro_scale", gyro_scale, -100.0, 100.0,
             "factor by which measured turn rates are larger than true ones, for faulty units; 1: no fault; -1: the "
             "unit hangs upside down and the log does not say so; 0: it is dead; 57.3: it measures in degrees");
    v.number("accelerometer_bias", accelerometer_bias, 0.0, 5.0,
             "standard deviation, at the start, of the acceleration's bias along each axis, in m/s^2; larger values "
             "measure wrong accelerations");
  }
};

}  // namespace mapweave::simulation
