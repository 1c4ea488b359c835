#include "picture_messages.h"

#include "../calibration_file.h"
#include "../jpeg_words.h"
#include "../picture_file.h"

#include <mapweave/core/error.h>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

namespace mapweave::rawlog::ros {
namespace {

constexpr std::uint32_t kMostSide = 20000;
constexpr double kMillimetres = 1000.0;

constexpr const char* kWithoutCamera =
    "read rectified pictures, as image_proc makes them, or leave the camera out: name the topics to read in "
    "reading.topics";

constexpr const char* kWithoutCloud =
    "read it as planar scans (reading.point_clouds=scans), or leave it out: name the topics to read in reading.topics";

constexpr int kNoConversion = -1;
struct Encoding {
  std::string_view name;
  int type;        // of OpenCV
  int conversion;  // to BGR or grey
};
// http://docs.ros.org/en/api/sensor_msgs/html/image__encodings_8h.html
// OpenCV names Bayer patterns by the second row's second and third pixel, ROS by the first row's first two.
constexpr std::array<Encoding, 16> kEncodings{{{"mono8", CV_8UC1, kNoConversion},
                                               {"8UC1", CV_8UC1, kNoConversion},
                                               {"bgr8", CV_8UC3, kNoConversion},
                                               {"8UC3", CV_8UC3, kNoConversion},
                                               {"rgb8", CV_8UC3, cv::COLOR_RGB2BGR},
                                               {"bgra8", CV_8UC4, cv::COLOR_BGRA2BGR},
                                               {"8UC4", CV_8UC4, cv::COLOR_BGRA2BGR},
                                               {"rgba8", CV_8UC4, cv::COLOR_RGBA2BGR},
                                               {"bayer_rggb8", CV_8UC1, cv::COLOR_BayerBG2BGR},
                                               {"bayer_bggr8", CV_8UC1, cv::COLOR_BayerRG2BGR},
                                               {"bayer_gbrg8", CV_8UC1, cv::COLOR_BayerGR2BGR},
                                               {"bayer_grbg8", CV_8UC1, cv::COLOR_BayerGB2BGR},
                                               {"yuv422", CV_8UC2, cv::COLOR_YUV2BGR_UYVY},
                                               {"uyvy", CV_8UC2, cv::COLOR_YUV2BGR_UYVY},
                                               {"yuv422_yuy2", CV_8UC2, cv::COLOR_YUV2BGR_YUY2},
                                               {"yuyv", CV_8UC2, cv::COLOR_YUV2BGR_YUY2}}};

// The rows of a message as OpenCV sees them, without a copy.
cv::Mat rows_of(const ImageMessage& message, int type) {
  const std::uint64_t row = std::uint64_t{message.width} * CV_ELEM_SIZE(type);
  const bool has_size =
      message.width > 0 && message.height > 0 && message.width <= kMostSide && message.height <= kMostSide;
  if (!has_size || message.step_bytes < row ||
      message.data.size() < std::uint64_t{message.height - 1} * message.step_bytes + row)
    throw Error(ErrorCode::kBadInput,
                "a picture of " + std::to_string(message.width) + " x " + std::to_string(message.height) +
                    " pixels of '" + std::string(message.encoding) + "' has " + std::to_string(message.data.size()) +
                    " bytes in rows of " + std::to_string(message.step_bytes) + "; more were expected");
  return {static_cast<int>(message.height), static_cast<int>(message.width), type,
          const_cast<char*>(message.data.data()), message.step_bytes};
}

// Numbers of 16 bits in this processor's order (little-endian).
cv::Mat wide_rows(const ImageMessage& message) {
  cv::Mat rows = rows_of(message, CV_16UC1);
  if (!message.is_big_endian) return rows;
  rows = rows.clone();
  std::for_each(rows.begin<std::uint16_t>(), rows.end<std::uint16_t>(),
                [](std::uint16_t& value) { value = static_cast<std::uint16_t>(value << 8 | value >> 8); });
  return rows;
}

[[noreturn]] void refuse_encoding(std::string_view encoding, const std::string& expected) {
  throw Error(ErrorCode::kUnsupported,
              "a picture has the encoding '" + std::string(encoding) + "'; " + expected + " were expected");
}

mrpt::img::CImage owned(const cv::Mat& picture) { return {picture, mrpt::img::DEEP_COPY}; }

cv::Mat decoded(std::string_view data, int flags) {
  cv::Mat picture;
  try {
    static const std::string name = "a compressed picture of a bag";
    const PictureNamedToJpeg named(name);
    const cv::Mat bytes(1, static_cast<int>(data.size()), CV_8UC1, const_cast<char*>(data.data()));
    picture = cv::imdecode(bytes, flags);
  } catch (const std::exception&) {
    picture.release();
  }
  if (picture.empty())
    throw Error(ErrorCode::kCorrupt,
                "a compressed picture of " + std::to_string(data.size()) + " bytes cannot be decoded");
  return picture;
}

// Sizes are looked at before a decoder makes room for them.
void expect_size(std::string_view data) {
  std::uint32_t width = 0, height = 0;
  const auto number = [&](std::size_t place) {
    std::uint32_t value = 0;
    for (std::size_t i = place; i < place + 4; ++i) value = value << 8 | static_cast<unsigned char>(data[i]);
    return value;
  };
  if (data.size() > 26 && data.substr(1, 3) == "PNG") {
    width = number(16);
    height = number(20);
  } else if (const auto jpeg = jpeg_size(data)) {
    width = jpeg->width;
    height = jpeg->height;
  }
  if (width == 0 || height == 0 || width > kMostSide || height > kMostSide)
    throw Error(ErrorCode::kCorrupt, "a compressed picture is no PNG or JPEG of a size that can be");
}

std::uint16_t steps_of(double depth_m) {
  const double steps = std::round(depth_m * kMillimetres);
  return steps >= 1.0 && steps <= 65535.0 ? static_cast<std::uint16_t>(steps) : 0;
}

mrpt::math::CMatrix_u16 matrix_of(const cv::Mat& steps) {
  mrpt::math::CMatrix_u16 depth(steps.rows, steps.cols);
  for (int row = 0; row < steps.rows; ++row)
    std::memcpy(&depth(row, 0), steps.ptr<std::uint16_t>(row),
                static_cast<std::size_t>(steps.cols) * sizeof(std::uint16_t));
  return depth;
}

template <class Depth_m>  // depth_m(row, column)
mrpt::math::CMatrix_u16 matrix_of(int rows, int columns, const Depth_m& depth_m) {
  mrpt::math::CMatrix_u16 depth(rows, columns);
  for (int row = 0; row < rows; ++row)
    for (int column = 0; column < columns; ++column) depth(row, column) = steps_of(depth_m(row, column));
  return depth;
}

// The three radial numbers of plumb_bob that come nearest to a rational model within the picture, and how far they are
// off.
struct NearestRadial {
  Eigen::Vector3d k;
  double error_px;
};
NearestRadial nearest_radial(const std::vector<double>& d, double most_radius, double focal_px) {
  constexpr int kSamples = 200;
  Eigen::Matrix<double, kSamples, 3> slopes;
  Eigen::Matrix<double, kSamples, 1> wanted;
  for (int i = 0; i < kSamples; ++i) {
    const double r = most_radius * (i + 1) / kSamples, r2 = r * r, r4 = r2 * r2, r6 = r4 * r2;
    const double factor = (1.0 + d[0] * r2 + d[1] * r4 + d[4] * r6) / (1.0 + d[5] * r2 + d[6] * r4 + d[7] * r6);
    slopes.row(i) << r * r2, r * r4, r * r6;
    wanted[i] = r * (factor - 1.0);
  }
  const Eigen::Vector3d k = slopes.colPivHouseholderQr().solve(wanted);
  return {k, focal_px * (slopes * k - wanted).cwiseAbs().maxCoeff()};
}

// Nullopt for other lenses. Without distortion, too, such a lens bends straight lines.
std::optional<std::array<double, 4>> fisheye_of(const CameraInfoMessage& message) {
  if (message.distortion_model != "equidistant" && message.distortion_model != "fisheye") return std::nullopt;
  const std::vector<double>& d = message.distortion;
  if (d.size() < 4 || std::any_of(d.begin() + 4, d.end(), [](double value) { return value != 0.0; }))
    throw Error(ErrorCode::kBadInput, "a calibration of a fisheye lens (" + std::string(message.distortion_model) +
                                          ") has " + std::to_string(d.size()) + " numbers; 4 were expected");
  return std::array<double, 4>{d[0], d[1], d[2], d[3]};
}

std::vector<double> distortion_of(const CameraInfoMessage& message, double fx, double fy, std::string& remark) {
  std::vector<double> d = message.distortion;
  const auto model = message.distortion_model;
  const bool is_none = std::all_of(d.begin(), d.end(), [](double value) { return value == 0.0; });
  if (is_none) return {};
  if (model == "plumb_bob" || (model.empty() && d.size() <= 5)) {
    if (d.size() < 4)
      throw Error(ErrorCode::kBadInput, "a calibration of plumb_bob has " + std::to_string(d.size()) +
                                            " numbers of distortion; 4 or 5 were expected");
    d.resize(std::min<std::size_t>(d.size(), 5));
    return d;
  }
  if (model != "rational_polynomial" || d.size() < 8)
    throw Error(ErrorCode::kUnsupported,
                "a calibration has the distortion model '" + std::string(model) + "' of " + std::to_string(d.size()) +
                    " numbers; plumb_bob (5), rational_polynomial (8) or equidistant (4) were expected",
                {}, kWithoutCamera);
  const double x = 0.5 * message.width / fx, y = 0.5 * message.height / fy;
  const NearestRadial nearest = nearest_radial(d, std::hypot(x, y), fx);
  if (!nearest.k.allFinite()) throw Error(ErrorCode::kBadInput, "a calibration of rational_polynomial makes no sense");
  if (nearest.error_px > 0.5)
    remark = "its lens is of the model rational_polynomial, which three radial numbers follow within " +
             std::to_string(nearest.error_px) + " pixels; rectify its pictures for more";
  return {nearest.k[0], nearest.k[1], d[2], d[3], nearest.k[2]};
}

}  // namespace

mrpt::img::CImage to_picture(const ImageMessage& message) {
  if (message.encoding == "mono16" || message.encoding == "16UC1") {
    cv::Mat grey;
    wide_rows(message).convertTo(grey, CV_8U, 1.0 / 256.0);
    return owned(grey);
  }
  const auto known = std::find_if(kEncodings.begin(), kEncodings.end(),
                                  [&](const Encoding& one) { return one.name == message.encoding; });
  if (known == kEncodings.end())
    refuse_encoding(message.encoding, "mono8, mono16, rgb8, bgr8, rgba8, bgra8, bayer_*8 or yuv422");
  const cv::Mat rows = rows_of(message, known->type);
  if (known->conversion == kNoConversion) return owned(rows);
  const bool is_bayer = known->type == CV_8UC1, is_yuv = known->type == CV_8UC2;
  if ((is_bayer && (rows.cols < 2 || rows.rows < 2)) || (is_yuv && rows.cols % 2 != 0))
    throw Error(ErrorCode::kBadInput,
                "a picture of '" + std::string(message.encoding) + "' has a size that it cannot have");
  cv::Mat colour;
  cv::cvtColor(rows, colour, known->conversion);
  return owned(colour);
}

mrpt::img::CImage to_picture(const CompressedImageMessage& message) {
  expect_size(message.data);
  cv::Mat picture = decoded(message.data, cv::IMREAD_ANYCOLOR);  // 8 bits
  return owned(picture);
}

mrpt::math::CMatrix_u16 to_depth(const ImageMessage& message) {
  if (message.encoding == "16UC1" || message.encoding == "mono16") return matrix_of(wide_rows(message));
  if (message.encoding != "32FC1" || message.is_big_endian)
    refuse_encoding(std::string(message.encoding) + (message.is_big_endian ? "' (big-endian) '" : ""),
                    "depth of 16UC1 (millimetres) or 32FC1 (metres)");
  const cv::Mat rows = rows_of(message, CV_32FC1);
  return matrix_of(rows.rows, rows.cols, [&](int row, int column) {
    float depth_m = 0.0f;
    std::memcpy(&depth_m, rows.ptr(row) + static_cast<std::size_t>(column) * sizeof depth_m, sizeof depth_m);
    return std::isfinite(depth_m) ? depth_m : 0.0f;
  });
}

mrpt::math::CMatrix_u16 to_depth(const CompressedImageMessage& message) {
  constexpr std::size_t kHeader = 12;  // a number of the format, two of the quantisation
  if (message.data.size() <= kHeader) throw Error(ErrorCode::kCorrupt, "a compressed depth picture is cut short");
  float quantisation[2];
  std::memcpy(quantisation, message.data.data() + 4, sizeof quantisation);
  const auto png = message.data.substr(kHeader);
  expect_size(png);
  const cv::Mat steps = decoded(png, cv::IMREAD_UNCHANGED);
  if (steps.type() != CV_16UC1) refuse_encoding(message.format, "compressed depth of 16 bits");
  if (message.format.substr(0, 5) != "32FC1") return matrix_of(steps);
  const double a = quantisation[0], b = quantisation[1];
  return matrix_of(steps.rows, steps.cols, [&](int row, int column) {
    const std::uint16_t value = steps.at<std::uint16_t>(row, column);
    return value == 0 ? 0.0 : a / (value - b);
  });
}

mrpt::math::CMatrix_u16 to_depth(const CloudPoints& points) {
  if (points.rows() < 2 || points.rows() > kMostSide || points.columns() > kMostSide)
    throw Error(ErrorCode::kBadInput,
                "a point cloud of " + std::to_string(points.columns()) + " x " + std::to_string(points.rows()) +
                    " points is not organised; of a depth camera a point for each pixel was expected",
                {}, kWithoutCloud);
  return matrix_of(static_cast<int>(points.rows()), static_cast<int>(points.columns()), [&](int row, int column) {
    const double depth_m = points.at(static_cast<std::uint32_t>(row), static_cast<std::uint32_t>(column)).z();
    return std::isfinite(depth_m) ? depth_m : 0.0;
  });
}

mrpt::img::CImage to_picture(const CloudPoints& points) {
  cv::Mat picture(static_cast<int>(points.rows()), static_cast<int>(points.columns()), CV_8UC3);
  for (int row = 0; row < picture.rows; ++row)
    for (int column = 0; column < picture.cols; ++column) {
      const auto colour = points.blue_green_red(static_cast<std::uint32_t>(row), static_cast<std::uint32_t>(column));
      picture.at<cv::Vec3b>(row, column) = {colour[0], colour[1], colour[2]};
    }
  return owned(picture);
}

ConvertedCalibration to_calibration(const CameraInfoMessage& message, bool is_rectified) {
  ConvertedCalibration converted;
  const auto& k = message.camera_matrix;
  const auto& p = message.projection;
  const double fx = is_rectified ? p[0] : k[0], fy = is_rectified ? p[5] : k[4];
  if (!(fx > 0.0 && fy > 0.0)) return converted;
  std::vector<double> distortion;
  if (!is_rectified) converted.fisheye = fisheye_of(message);
  if (!is_rectified && !converted.fisheye) distortion = distortion_of(message, fx, fy, converted.remark);
  const double binning_x = std::max(1U, message.binning_x), binning_y = std::max(1U, message.binning_y);
  const bool has_region = message.roi_width > 0 && message.roi_height > 0;
  const double width = std::floor((has_region ? message.roi_width : message.width) / binning_x);
  const double height = std::floor((has_region ? message.roi_height : message.height) / binning_y);
  const double cx = (is_rectified ? p[2] : k[2]) - (has_region ? message.roi_x : 0);
  const double cy = (is_rectified ? p[6] : k[5]) - (has_region ? message.roi_y : 0);
  converted.camera =
      make_camera(width, height, {fx / binning_x, fy / binning_y, cx / binning_x, cy / binning_y}, distortion, {});
  return converted;
}

}  // namespace mapweave::rawlog::ros
