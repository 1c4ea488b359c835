#pragma once
// Pictures and calibrations of ROS 1, for tests.

#include "bags.h"

namespace mapweave::rawlog {

constexpr std::uint32_t kWidth = 4, kHeight = 2;

inline BagEntry picture(const std::string& topic, double stamp_s, const std::string& encoding,
                        const std::string& pixels, const std::string& frame = "optical") {
  MessageBytes bytes;
  bytes.header(stamp_s, frame).number(kHeight).number(kWidth).text(encoding).number(std::uint8_t{0});
  bytes.number(static_cast<std::uint32_t>(pixels.size() / kHeight)).text(pixels);
  return {topic, "sensor_msgs/Image", stamp_s, bytes.bytes()};
}

inline BagEntry grey(const std::string& topic, double stamp_s, char value = 100) {
  return picture(topic, stamp_s, "mono8", std::string(kWidth * kHeight, value));
}

struct Calibration {
  std::string model = "plumb_bob";
  std::vector<double> distortion = {0.1, -0.2, 0.001, 0.002, 0.0};
  double baseline_times_fx = 0.0;
  std::uint32_t width = kWidth, height = kHeight, binning = 0;
};

inline BagEntry calibration(const std::string& topic, double stamp_s, const Calibration& of = {}) {
  MessageBytes bytes;
  bytes.header(stamp_s, "optical").number(of.height).number(of.width).text(of.model);
  bytes.number(static_cast<std::uint32_t>(of.distortion.size())).doubles(of.distortion);
  bytes.doubles({400, 0, 2, 0, 410, 1, 0, 0, 1}).doubles({1, 0, 0, 0, 1, 0, 0, 0, 1});
  bytes.doubles({390, 0, 2.5, of.baseline_times_fx, 0, 390, 1.5, 0, 0, 0, 1, 0});
  bytes.number(of.binning).number(of.binning);
  for (int i = 0; i < 4; ++i) bytes.number(std::uint32_t{0});
  bytes.number(std::uint8_t{0});
  return {topic, "sensor_msgs/CameraInfo", stamp_s, bytes.bytes()};
}

inline std::string depth_pixels(std::uint16_t millimetres) {
  MessageBytes bytes;
  for (std::uint32_t i = 0; i < kWidth * kHeight; ++i) bytes.number(static_cast<std::uint16_t>(millimetres + i));
  return bytes.bytes();
}

// An organised cloud: what a camera of calibration()'s projection sees at these depths in metres, row by row.
inline BagEntry depth_cloud(const std::string& topic, double stamp_s, const std::vector<float>& depths_m,
                            const std::string& frame = "optical") {
  CloudForm form;
  form.width = kWidth;
  form.height = kHeight;
  form.topic = topic;
  form.frame = frame;
  MessageBytes bytes;
  for (std::uint32_t i = 0; i < depths_m.size(); ++i) {
    const float x = static_cast<float>(i % kWidth) - 2.5f, y = static_cast<float>(i / kWidth) - 1.5f;
    bytes.floats({x * depths_m[i] / 390.0f, y * depths_m[i] / 390.0f, depths_m[i]});
  }
  return bag_cloud(stamp_s, form, bytes.bytes());
}

}  // namespace mapweave::rawlog
