#include "external_images.h"

#include "jpeg_words.h"
#include "picture_file.h"

#include <mapweave/core/error.h>
#include <mapweave/rawlog/observation_stream.h>
#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/obs/CObservation3DRangeScan.h>
#include <mrpt/obs/CObservationImage.h>
#include <mrpt/obs/CObservationOdometry.h>
#include <mrpt/obs/CObservationStereoImages.h>

#include <string>

namespace mapweave::rawlog {
namespace {

void make_absolute(std::string& file, const std::filesystem::path& folder) {
  const std::filesystem::path path(file);
  if (!path.is_absolute()) file = (folder / path).string();
}

void make_absolute(mrpt::img::CImage& image, const std::filesystem::path& folder) {
  if (!image.isExternallyStored()) return;
  std::string file = image.getExternalStorageFile();
  make_absolute(file, folder);
  image.setExternalStorage(file);
}

// MRPT keeps these names for itself and what derives from it.
struct DepthFiles : mrpt::obs::CObservation3DRangeScan {
  static std::string& points(CObservation3DRangeScan& scan) { return scan.*(&DepthFiles::m_points3D_external_file); }
  static std::string& ranges(CObservation3DRangeScan& scan) { return scan.*(&DepthFiles::m_rangeImage_external_file); }
};

void require(const std::string& file) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(file, ignored)) {
    throw Error(ErrorCode::kMissing, "a picture of the log is missing", file,
                "put the log's folder of pictures (NAME_Images) beside it");
  }
}

// `calibration` may say nothing: then the picture has any size.
void load(const mrpt::img::CImage& image, const mrpt::img::TCamera* calibration, const std::string& label) {
  const std::string file = image.isExternallyStored() ? image.getExternalStorageFile() : "";
  const std::string where = file.empty() ? "a picture of '" + label + "' within the log" : file;
  if (!file.empty()) {
    require(file);
    if (is_png_or_jpeg(file)) look_at_picture(file);
  }
  const PictureNamedToJpeg naming(where);
  try {
    image.forceLoad();
  } catch (const std::exception& problem) {
    throw Error(ErrorCode::kCorrupt,
                "a picture of the log cannot be read (" + std::string(problem.what()).substr(0, 200) + ")", where,
                "copy the pictures of the log again");
  }
  const auto columns = image.getWidth(), rows = image.getHeight();
  if (columns == 0 || rows == 0)
    throw Error(ErrorCode::kCorrupt, "a picture of the log has no pixels", where, "copy the pictures of the log again");
  if (calibration == nullptr || calibration->fx() <= 0.0 ||
      (calibration->ncols == columns && calibration->nrows == rows))
    return;
  throw Error(ErrorCode::kBadInput,
              "the picture has " + std::to_string(columns) + " x " + std::to_string(rows) + " pixels; " +
                  std::to_string(calibration->ncols) + " x " + std::to_string(calibration->nrows) +
                  " were expected by the calibration of '" + label + "'",
              where, "record it with the calibration of these pictures");
}

}  // namespace

std::filesystem::path images_folder(const std::filesystem::path& log) {
  const auto parent = std::filesystem::absolute(log).lexically_normal().parent_path();
  auto stem = log.filename();
  if (stem.extension() == ".gz") stem = stem.stem();
  for (const char* ending : {"_Images", "_images"}) {
    const auto folder = parent / (stem.stem().string() + ending);
    std::error_code ignored;
    if (std::filesystem::is_directory(folder, ignored)) return folder;
  }
  return parent;
}

void make_image_paths_absolute(mrpt::obs::CObservation& observation, const std::filesystem::path& folder) {
  if (IS_CLASS(observation, mrpt::obs::CObservation2DRangeScan) ||
      IS_CLASS(observation, mrpt::obs::CObservationOdometry))
    return;  // nearly all
  if (auto* image = dynamic_cast<mrpt::obs::CObservationImage*>(&observation)) {
    make_absolute(image->image, folder);
  } else if (auto* stereo = dynamic_cast<mrpt::obs::CObservationStereoImages*>(&observation)) {
    make_absolute(stereo->imageLeft, folder);
    if (stereo->hasImageRight) make_absolute(stereo->imageRight, folder);
    if (stereo->hasImageDisparity) make_absolute(stereo->imageDisparity, folder);
  } else if (auto* depth = dynamic_cast<mrpt::obs::CObservation3DRangeScan*>(&observation)) {
    if (depth->hasIntensityImage) make_absolute(depth->intensityImage, folder);
    if (depth->hasConfidenceImage) make_absolute(depth->confidenceImage, folder);
    if (depth->points3D_isExternallyStored()) make_absolute(DepthFiles::points(*depth), folder);
    if (depth->rangeImage_isExternallyStored()) make_absolute(DepthFiles::ranges(*depth), folder);
  }
}

void load_pictures(const mrpt::obs::CObservation& observation) {
  const std::string& label = observation.sensorLabel;
  if (const auto* image = dynamic_cast<const mrpt::obs::CObservationImage*>(&observation)) {
    load(image->image, &image->cameraParams, label);
  } else if (const auto* stereo = dynamic_cast<const mrpt::obs::CObservationStereoImages*>(&observation)) {
    load(stereo->imageLeft, &stereo->leftCamera, label);
    if (stereo->hasImageRight) load(stereo->imageRight, &stereo->rightCamera, label);
    if (stereo->hasImageDisparity) load(stereo->imageDisparity, nullptr, label);
  } else if (const auto* depth = dynamic_cast<const mrpt::obs::CObservation3DRangeScan*>(&observation)) {
    if (depth->hasIntensityImage) load(depth->intensityImage, &depth->cameraParamsIntensity, label);
    if (depth->hasConfidenceImage) load(depth->confidenceImage, nullptr, label);
    if (depth->points3D_isExternallyStored()) require(depth->points3D_getExternalStorageFile());
    if (depth->rangeImage_isExternallyStored()) require(depth->rangeImage_getExternalStorageFile(""));
    try {
      depth->load();
    } catch (const std::exception& problem) {
      throw Error(ErrorCode::kCorrupt,
                  "depth of the log cannot be read (" + std::string(problem.what()).substr(0, 200) + ")",
                  "observation '" + label + "'", "copy the pictures of the log again");
    }
  }
}

}  // namespace mapweave::rawlog
