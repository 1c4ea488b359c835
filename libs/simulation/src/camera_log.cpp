#include "camera_log.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/core/format.h>
#include <mapweave/simulation/observations.h>

#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include <cinttypes>
#include <cmath>
#include <fstream>

namespace mapweave::simulation {
namespace {

std::string seconds_text(Stamp stamp) {
  return format("%" PRId64 ".%06" PRId64, stamp.ns / 1'000'000'000, stamp.ns % 1'000'000'000 / 1000);
}

// Not by write_file: nobody waits for a picture to reach the disk. The folder of the whole is committed at once.
void write_picture(const std::filesystem::path& path, const cv::Mat& picture, int jpeg_quality) {
  const bool is_jpeg = path.extension() == ".jpg";
  const std::vector<int> parameters = is_jpeg ? std::vector<int>{cv::IMWRITE_JPEG_QUALITY, jpeg_quality}
                                              : std::vector<int>{cv::IMWRITE_PNG_COMPRESSION, 1};
  std::vector<std::uint8_t> bytes;
  if (!cv::imencode(path.extension().string(), picture, bytes, parameters))
    throw Error(ErrorCode::kInternal, "the picture cannot be encoded", path.string());
  std::ofstream file(path, std::ios::binary);
  file.write(reinterpret_cast<const char*>(bytes.data()), static_cast<std::streamsize>(bytes.size()));
  file.close();
  if (!file)
    throw Error(ErrorCode::kCannotWrite, "cannot be written", path.string(), "check that the disk has space left");
}

void write_picture(const std::filesystem::path& path, const Picture& picture, int jpeg_quality) {
  auto* values = const_cast<std::uint8_t*>(picture.values.data());  // OpenCV has no view of constants; it only reads
  if (picture.channels == 1) {
    write_picture(path, cv::Mat(picture.height, picture.width, CV_8UC1, values), jpeg_quality);
  } else {
    cv::Mat blue_first;
    cv::cvtColor(cv::Mat(picture.height, picture.width, CV_8UC3, values), blue_first, cv::COLOR_RGB2BGR);
    write_picture(path, blue_first, jpeg_quality);
  }
}

void make_own_folder(const std::filesystem::path& path) { make_folder(path, ""); }

std::string camera_yaml(const CameraOptions& options) {
  const CameraIntrinsics c = options.intrinsics();
  const auto& d = c.distortion;
  const Pose3 pose = options.robot_from_camera();
  std::string text = format("robot_from_camera: [%.9g, %.9g, %.9g, %.9f, %.9f, %.9f, %.9f]\n", pose.t.x(), pose.t.y(),
                            pose.t.z(), pose.q.x(), pose.q.y(), pose.q.z(), pose.q.w());
  text += format("camera_model: pinhole\nwidth: %d\nheight: %d\nfx: %.9g\nfy: %.9g\ncx: %.9g\ncy: %.9g\n", c.width,
                 c.height, c.fx, c.fy, c.cx, c.cy);
  text += format("distortion_model: radial-tangential\ndistortion: [%.9g, %.9g, %.9g, %.9g, %.9g]\n", d[0], d[1], d[2],
                 d[3], d[4]);
  if (options.kind == SimulatedCameraKind::rgbd) text += "depth_scale: 5000.0\ndepth_registered_to_color: true\n";
  return text + format("rate_hz: %.9g\n", options.frames_per_second);
}

}  // namespace

std::string tum_line(Stamp stamp, const Pose3& pose) {
  return seconds_text(stamp) + format(" %.6f %.6f %.6f %.6f %.6f %.6f %.6f\n", pose.t.x() + 0.0, pose.t.y() + 0.0,
                                      pose.t.z() + 0.0, pose.q.x() + 0.0, pose.q.y() + 0.0, pose.q.z() + 0.0,
                                      pose.q.w() + 0.0);
}

CameraLog::CameraLog(const World& world, std::size_t robot, std::size_t camera, std::filesystem::path folder)
    : options_(world.options().logs),
      recording_(world, robot, camera),
      folder_(std::move(folder)),
      robot_(world.robot_id(robot).str()) {
  const CameraOptions& of_camera = recording_.options();
  own_folder_ = folder_ / (robot_ + "_" + of_camera.id);
  if (has_rawlog() && options_.pictures != PictureFormat::embedded) make_own_folder(folder_ / (robot_ + "_Images"));
  if (!has_folder()) return;
  if (of_camera.kind == SimulatedCameraKind::stereo) {
    if (of_camera.intrinsics().is_distorted())
      throw Error(ErrorCode::kBadInput, "the layout of folders has no place for a stereo camera's distortion",
                  "camera '" + of_camera.id + "'", "set logs.layout to rawlog, or k1 to k3 to 0");
    make_own_folder(own_folder_ / "image_0");
    make_own_folder(own_folder_ / "image_1");
    return;
  }
  make_own_folder(own_folder_ / "rgb");
  colour_list_ = "# timestamp filename\n";
  if (of_camera.kind == SimulatedCameraKind::rgbd) {
    make_own_folder(own_folder_ / "depth");
    depth_list_ = colour_list_;
  }
}

bool CameraLog::has_folder() const { return options_.layout != LogLayout::rawlog; }
bool CameraLog::has_rawlog() const { return options_.layout != LogLayout::folders; }

// Beside the rawlog, in the folder where readers look for what a log of this name keeps outside.
std::string CameraLog::picture_file(std::size_t frame, const char* side) const {
  return recording_.options().id +
         format("_%06zu%s.%s", frame, side, options_.pictures == PictureFormat::jpeg ? "jpg" : "png");
}

CameraLog::Entry CameraLog::make(std::size_t number, CameraRecording::Workspace& workspace) const {
  const CameraFrame frame = recording_.frame(number, workspace);
  const CameraOptions& camera = recording_.options();
  const bool is_stereo = camera.kind == SimulatedCameraKind::stereo;
  Entry entry{frame.stamp, frame.depth_stamp, frame.world_from_camera, nullptr};
  if (has_rawlog()) {
    PictureFiles files;
    if (options_.pictures != PictureFormat::embedded) {
      files.left = picture_file(number, is_stereo ? "_left" : "");
      write_picture(folder_ / (robot_ + "_Images") / files.left, frame.left, options_.jpeg_quality);
      if (is_stereo) {
        files.right = picture_file(number, "_right");
        write_picture(folder_ / (robot_ + "_Images") / files.right, frame.right, options_.jpeg_quality);
      }
    }
    entry.observation = camera_observation(frame, camera, files);
  }
  if (!has_folder()) return entry;
  const std::string ending = options_.pictures == PictureFormat::jpeg ? ".jpg" : ".png";
  if (is_stereo) {
    write_picture(own_folder_ / "image_0" / (format("%06zu", number) + ending), frame.left, options_.jpeg_quality);
    write_picture(own_folder_ / "image_1" / (format("%06zu", number) + ending), frame.right, options_.jpeg_quality);
  } else {
    write_picture(own_folder_ / "rgb" / (seconds_text(frame.stamp) + ending), frame.left, options_.jpeg_quality);
    if (camera.kind == SimulatedCameraKind::rgbd) {
      auto* depth = const_cast<std::uint16_t*>(frame.depth.data());  // as above
      write_picture(own_folder_ / "depth" / (seconds_text(frame.depth_stamp) + ".png"),
                    cv::Mat(camera.height, camera.width, CV_16UC1, depth), 0);
    }
  }
  return entry;
}

void CameraLog::add(const Entry& entry) {
  const std::string truth = tum_line(entry.stamp, entry.world_from_camera);
  truth_ += truth;
  if (!has_folder()) return;
  if (recording_.options().kind == SimulatedCameraKind::stereo) {
    if (!first_from_world_) {
      first_from_world_ = inverse(entry.world_from_camera);
      first_stamp_ = entry.stamp;
    }
    times_ += format("%.6f\n", seconds_between(first_stamp_, entry.stamp));
    const Pose3 first_from_camera = compose(*first_from_world_, entry.world_from_camera);
    const Eigen::Matrix3d r = first_from_camera.q.toRotationMatrix();
    for (int row = 0; row < 3; ++row)
      poses_ += format("%.9e %.9e %.9e %.9e%s", r(row, 0), r(row, 1), r(row, 2), first_from_camera.t[row],
                       row < 2 ? " " : "\n");
    return;
  }
  const std::string ending = options_.pictures == PictureFormat::jpeg ? ".jpg" : ".png";
  const std::string colour = seconds_text(entry.stamp) + " rgb/" + seconds_text(entry.stamp) + ending;
  colour_list_ += colour + "\n";
  if (recording_.options().kind != SimulatedCameraKind::rgbd) return;
  const std::string depth = seconds_text(entry.depth_stamp) + " depth/" + seconds_text(entry.depth_stamp) + ".png";
  depth_list_ += depth + "\n";
  pairs_ += colour + " " + depth + "\n";
}

void CameraLog::close() {
  const CameraOptions& camera = recording_.options();
  write_file(folder_ / (robot_ + "." + camera.id + ".truth.tum"), truth_);
  if (!has_folder()) return;
  if (camera.kind == SimulatedCameraKind::stereo) {
    const CameraIntrinsics c = camera.intrinsics();
    std::string calibration;
    for (const double baseline : {0.0, camera.baseline_m}) {
      calibration +=
          format("P%d: %.12e 0.000000000000e+00 %.12e %.12e 0.000000000000e+00 %.12e %.12e 0.000000000000e+00 ",
                 baseline > 0.0 ? 1 : 0, c.fx, c.cx, -c.fx * baseline, c.fy, c.cy) +
          "0.000000000000e+00 0.000000000000e+00 1.000000000000e+00 0.000000000000e+00\n";
    }
    write_file(own_folder_ / "calib.txt", calibration);
    write_file(own_folder_ / "times.txt", times_);
    write_file(own_folder_ / "poses.txt", poses_);
    return;
  }
  write_file(own_folder_ / "camera.yaml", camera_yaml(camera));
  write_file(own_folder_ / "rgb.txt", colour_list_);
  write_file(own_folder_ / "groundtruth.txt", "# timestamp tx ty tz qx qy qz qw\n" + truth_);
  if (camera.kind != SimulatedCameraKind::rgbd) return;
  write_file(own_folder_ / "depth.txt", depth_list_);
  write_file(own_folder_ / "associations.txt", pairs_);
}

}  // namespace mapweave::simulation
