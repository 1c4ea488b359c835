#pragma once
// Tiny camera folders of each layout, and what is equal in two observations of a camera.

#include "logs.h"

#include <mrpt/obs/CObservation3DRangeScan.h>
#include <mrpt/obs/CObservationIMU.h>
#include <mrpt/obs/CObservationImage.h>
#include <mrpt/obs/CObservationStereoImages.h>

#include <cstdio>
#include <opencv2/imgcodecs.hpp>

namespace mapweave::rawlog {

constexpr int kColumns = 32, kRows = 24;

inline std::string text_of(const char* form, double value) {
  char text[64];
  std::snprintf(text, sizeof text, form, value);
  return text;
}

// Each number another picture.
inline cv::Mat picture(int number, int type = CV_8UC3, int columns = kColumns, int rows = kRows) {
  cv::Mat image(rows, columns, type);
  const int channels = image.channels();
  for (int row = 0; row < rows; ++row) {
    for (int i = 0; i < columns * channels; ++i) {
      const int value = 7 * row + 3 * i + 11 * number;
      if (image.depth() == CV_16U)
        image.ptr<std::uint16_t>(row)[i] = static_cast<std::uint16_t>((row + i) % 9 == 0 ? 0 : 5000 + 13 * value);
      else
        image.ptr<std::uint8_t>(row)[i] = static_cast<std::uint8_t>(value);
    }
  }
  return image;
}

inline void write_picture(const std::filesystem::path& file, const cv::Mat& image) {
  std::filesystem::create_directories(file.parent_path());
  ASSERT_TRUE(cv::imwrite(file.string(), image));
}

inline void replace_text(const std::filesystem::path& file, const std::string& from, const std::string& to) {
  std::string text = bytes_of(file);
  const auto at = text.find(from);
  ASSERT_NE(at, std::string::npos) << from << " is not in " << file;
  write_bytes(file, text.replace(at, from.size(), to));
}

constexpr const char* kCameraYaml =
    "width: 32\nheight: 24\nfx: 30.5\nfy: 31.0\ncx: 15.5\ncy: 11.25\n"
    "distortion: [0.26, -0.95, -0.005, 0.0026, 1.16]\ndepth_scale: 5000.0\n";

// Ten frames at 10 Hz from 100 s; depth comes 4 ms after colour.
inline std::filesystem::path make_tum(const std::filesystem::path& folder, int frames = 10,
                                      double depth_delay_s = 0.004) {
  std::string colour = "# color images\n# timestamp filename\n", depth = "# depth maps\n";
  for (int i = 0; i < frames; ++i) {
    const std::string first = text_of("%.6f", 100.0 + 0.1 * i),
                      second = text_of("%.6f", 100.0 + 0.1 * i + depth_delay_s);
    write_picture(folder / "rgb" / (first + ".png"), picture(i));
    write_picture(folder / "depth" / (second + ".png"), picture(i, CV_16UC1));
    colour += first + " rgb/" + first + ".png\n";
    depth += second + " depth/" + second + ".png\n";
  }
  write_bytes(folder / "rgb.txt", colour);
  write_bytes(folder / "depth.txt", depth);
  write_bytes(folder / "camera.yaml", kCameraYaml);
  write_bytes(folder / "groundtruth.txt", "100.0 0 0 0 0 0 0 1\n");
  write_bytes(folder / "accelerometer.txt", "# timestamp ax ay az\n100.05 0.1 9.7 0.2\n100.55 0.3 9.8 0.4\n");
  return folder;
}

// Ten pairs at 10 Hz from 0 s; the right camera stands half a metre right.
inline std::filesystem::path make_kitti(const std::filesystem::path& folder, int frames = 10) {
  std::string times, poses;
  for (int i = 0; i < frames; ++i) {
    const std::string name = "00000" + std::to_string(i) + ".png";
    write_picture(folder / "image_0" / name, picture(i, CV_8UC1));
    write_picture(folder / "image_1" / name, picture(i + 50, CV_8UC1));
    times += text_of("%e\n", 0.1 * i);
    poses += "1 0 0 0 0 1 0 0 0 0 1 " + std::to_string(i) + "\n";
  }
  write_bytes(folder / "times.txt", times);
  write_bytes(folder / "poses.txt", poses);
  write_bytes(folder / "calib.txt",
              "P0: 30 0 16 0 0 30 12 0 0 0 1 0\nP1: 30 0 16 -15 0 30 12 0 0 0 1 0\nTr: 0 -1 0 0 0 0 -1 0 1 0 0 0\n");
  return folder;
}

inline std::string euroc_sensor(double y_m) {
  return "%YAML:1.0\nsensor_type: camera\nT_BS:\n  cols: 4\n  rows: 4\n  data: [0, -1, 0, 0.1,\n    1, 0, 0, " +
         std::to_string(y_m) +
         ",\n    0, 0, 1, 0.3,\n    0, 0, 0, 1]\nresolution: [32, 24]\ncamera_model: pinhole\nintrinsics: [30, 31, 15, "
         "11] #fu\n"
         "distortion_model: radial-tangential\ndistortion_coefficients: [-0.28, 0.07, 0.0002, 1.8e-05]\n";
}

// Ten pairs at 10 Hz from 1403715273 s, as published; the IMU at 50 Hz.
inline std::filesystem::path make_euroc(const std::filesystem::path& folder, int frames = 10) {
  constexpr std::int64_t kStart = 1403715273'262142976;
  for (const int camera : {0, 1}) {
    const auto place = folder / "mav0" / ("cam" + std::to_string(camera));
    std::string list = "#timestamp [ns],filename\r\n";
    for (int i = 0; i < frames; ++i) {
      const std::string stamp = std::to_string(kStart + i * 100'000'000LL);
      write_picture(place / "data" / (stamp + ".png"), picture(i + 50 * camera, CV_8UC1));
      list += stamp + "," + stamp + ".png\r\n";
    }
    write_bytes(place / "data.csv", list);
    write_bytes(place / "sensor.yaml", euroc_sensor(-0.1 + 0.2 * camera));
  }
  std::filesystem::create_directories(folder / "mav0/imu0");
  std::string imu = "#timestamp [ns],w_RS_S_x [rad s^-1],...\n";
  for (int i = 0; i < 5 * frames; ++i) imu += std::to_string(kStart + i * 20'000'000LL) + ",0.1,0.2,0.3,9.8,0.5,-3.7\n";
  write_bytes(folder / "mav0/imu0/data.csv", imu);
  return folder;
}

// The same, on one level.
inline std::filesystem::path make_reduced_euroc(const std::filesystem::path& folder, int frames = 10) {
  std::string list = "# timestamp[s] left right\n";
  for (int i = 0; i < frames; ++i) {
    const std::string stamp = std::to_string(1403715273'262142976 + i * 100'000'000LL);
    write_picture(folder / "cam0" / (stamp + ".png"), picture(i, CV_8UC1));
    write_picture(folder / "cam1" / (stamp + ".png"), picture(i + 50, CV_8UC1));
    list += stamp.substr(0, 10) + "." + stamp.substr(10) + " cam0/" + stamp + ".png cam1/" + stamp + ".png\n";
  }
  write_bytes(folder / "stereo.txt", list);
  write_bytes(folder / "cam0_sensor.yaml", euroc_sensor(-0.1));
  write_bytes(folder / "cam1_sensor.yaml", euroc_sensor(0.1));
  write_bytes(folder / "imu0.csv", "#timestamp [ns],...\n1403715273262142976,0.1,0.2,0.3,9.8,0.5,-3.7\n");
  return folder;
}

// Of what a consumer sees: the pixels, decoded, and everything else as MRPT writes it.
inline std::string seen(const Record& record) {
  load_pictures(*record.observation);
  std::string bytes = std::to_string(record.stamp.ns);
  const auto add = [&](const mrpt::img::CImage& image) {
    const cv::Mat pixels = image.asCvMat<cv::Mat>(mrpt::img::DEEP_COPY);
    bytes += ";" + std::to_string(pixels.type()) + ";" + std::to_string(pixels.cols) + ";";
    for (int row = 0; row < pixels.rows; ++row)
      bytes.append(pixels.ptr<char>(row), static_cast<std::size_t>(pixels.cols) * pixels.elemSize());
  };
  if (const auto* image = dynamic_cast<const mrpt::obs::CObservationImage*>(record.observation.get()))
    add(image->image);
  if (const auto* stereo = dynamic_cast<const mrpt::obs::CObservationStereoImages*>(record.observation.get())) {
    add(stereo->imageLeft);
    add(stereo->imageRight);
  }
  if (const auto* depth = dynamic_cast<const mrpt::obs::CObservation3DRangeScan*>(record.observation.get()))
    add(depth->intensityImage);
  return bytes + serialized(*record.observation);
}

inline const mrpt::obs::CObservation3DRangeScan& depth_of(const Record& record) {
  return dynamic_cast<const mrpt::obs::CObservation3DRangeScan&>(*record.observation);
}

// Of the observations of one kind.
template <class Observation>
std::vector<Record> of_class(const std::vector<Record>& records) {
  std::vector<Record> chosen;
  for (const Record& record : records)
    if (dynamic_cast<const Observation*>(record.observation.get()) != nullptr) chosen.push_back(record);
  return chosen;
}

}  // namespace mapweave::rawlog
