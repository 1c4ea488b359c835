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
    v.number("exposure_ms", exposure_ms, 0.0, 100.0, "what moves meanwhile is blurred; the stamp is its middle");
    v.number("exposure_change", exposure_change, 0.0, 1.0,
             "brightness wanders by this share (standard deviation) within seconds");
    v.number("vignetting", vignetting, 0.0, 0.9, "the corners are darker by this share");
    v.number("noise", noise, 0.0, 50.0, "standard deviation of a channel, grey levels");
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
    v.number("noise_m", noise_m, 0.0, 1.0, "standard deviation of a depth z before quantisation: this");
    v.number("noise_per_m2", noise_per_m2, 0.0, 0.1, "plus this times z^2, alike within 3 x 3 pixels");
    v.number("step_per_m2", step_per_m2, 0.0, 0.1,
             "depths come in steps of this times z^2 (whole steps of disparity); 0: unquantised");
    v.number("min_range_m", min_range_m, 0.0, 5.0, "nothing is measured nearer");
    v.number("max_range_m", max_range_m, 0.5, 13.0, "or farther");
    v.number("grazing_deg", grazing_deg, 45.0, 90.0, "or on surfaces that are turned away by more than this");
    v.number("shadow_m", shadow_m, 0.0, 0.5, "or where a projector this far to the camera's right throws no light");
    v.fraction("dropouts", dropouts, "share of pixels without a depth for no reason");
    v.number("offset_ms", offset_ms, 0.0, 20.0,
             "the depth is taken up to this long before or after the colour, drifting by 1 ms/s; a TUM folder has "
             "its stamp, a rawlog "
             "cannot");
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
    v.text("id", id, "the camera's name: the label of its observations");
    v.choice("kind", kind,
             {{"mono", SimulatedCameraKind::mono},
              {"stereo", SimulatedCameraKind::stereo},
              {"rgbd", SimulatedCameraKind::rgbd}},
             "one picture, a left and a right one, or one with its depths (registered)");
    v.integer("width", width, 16, 4096, "pixels");
    v.integer("height", height, 16, 4096, "pixels");
    v.number("fx", fx, 1.0, 100000.0, "focal length, pixels");
    v.number("fy", fy, 1.0, 100000.0, "focal length, pixels");
    v.number("cx", cx, -1.0, 4096.0, "principal point; -1: the middle");
    v.number("cy", cy, -1.0, 4096.0, "principal point; -1: the middle");
    v.number("k1", k1, -10.0, 10.0, "radial distortion");
    v.number("k2", k2, -10.0, 10.0, "radial distortion");
    v.number("p1", p1, -1.0, 1.0, "tangential distortion");
    v.number("p2", p2, -1.0, 1.0, "tangential distortion");
    v.number("k3", k3, -10.0, 10.0, "radial distortion");
    v.number("frames_per_second", frames_per_second, 0.1, 200.0, "the first one is taken at the robot's start");
    v.flag("colour", colour, "colour pictures instead of grey ones");
    v.number("x_m", x_m, -5.0, 5.0, "where it (the left one) sits on the robot: ahead");
    v.number("y_m", y_m, -5.0, 5.0, "to the left");
    v.number("z_m", z_m, 0.01, 5.0, "above the floor");
    v.number("yaw_deg", yaw_deg, -180.0, 180.0, "turned counter-clockwise");
    v.number("pitch_deg", pitch_deg, -90.0, 90.0, "tipped down");
    v.number("roll_deg", roll_deg, -180.0, 180.0, "and turned about its axis");
    v.number("baseline_m", baseline_m, 0.001, 5.0, "stereo: from the left camera to the right one");
    v.number("dark_from_s", dark_from_s, 0.0, 100000.0, "it is covered from this time after the robot's start");
    v.number("dark_for_s", dark_for_s, 0.0, 100000.0, "for this long, while the robot drives on");
    v.section("image", image, "how pictures differ from what is there");
    v.section("depth", depth, "rgbd: how depths do");
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
    v.number("readings_per_second", readings_per_second, 0.0, 1000.0, "0: none");
    v.number("gyro_noise", gyro_noise, 0.0, 1.0, "density, rad/s/sqrt(Hz) (ADIS16448, as are the next three)");
    v.number("gyro_walk", gyro_walk, 0.0, 1.0, "of the bias, rad/s^2/sqrt(Hz)");
    v.number("accelerometer_noise", accelerometer_noise, 0.0, 1.0, "density, m/s^2/sqrt(Hz)");
    v.number("accelerometer_walk", accelerometer_walk, 0.0, 1.0, "of the bias, m/s^3/sqrt(Hz)");
    v.number("gyro_bias", gyro_bias, 0.0, 1.0, "standard deviation of each axis' bias at the start, rad/s");
    v.number("gyro_scale", gyro_scale, -100.0, 100.0,
             "turns are measured this many times as large; -1: it hangs upside down and the log does not say so, 0: it "
             "is dead, 57.3: in degrees");
    v.number("accelerometer_bias", accelerometer_bias, 0.0, 5.0, "the same, m/s^2");
  }
};

}  // namespace mapweave::simulation
