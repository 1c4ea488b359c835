#include <mapweave/core/error.h>
#include <mapweave/core/median.h>
#include <mapweave/laser/depth_scans.h>

#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/obs/CObservation3DRangeScan.h>

#include <algorithm>
#include <cmath>
#include <utility>
#include <vector>

namespace mapweave::laser {
namespace {

using mrpt::obs::CObservation2DRangeScan;
using mrpt::obs::CObservation3DRangeScan;

constexpr double kRay_rad = 0.5 * M_PI / 180.0, kBand_rad = 2.0 * M_PI / 180.0;

// Pixels along the rows and columns of a depth picture.
struct Lens {
  int width, height;
  double fx, fy, cx, cy;
};

Lens lens_of(const CObservation3DRangeScan& picture) {
  const Lens lens{static_cast<int>(picture.rangeImage.cols()),
                  static_cast<int>(picture.rangeImage.rows()),
                  picture.cameraParams.fx(),
                  picture.cameraParams.fy(),
                  picture.cameraParams.cx(),
                  picture.cameraParams.cy()};
  const bool is_sound = lens.fx > 1.0 && lens.fy > 1.0 && lens.fx < 1e6 && lens.fy < 1e6 && lens.cx > 0.0 &&
                        lens.cx < lens.width - 1 && lens.cy > 0.0 && lens.cy < lens.height - 1 &&
                        picture.rangeUnits > 0.0F;
  if (!is_sound)
    throw Error(ErrorCode::kBadInput,
                "depth camera '" + picture.sensorLabel + "' has no calibration that fits its depth pictures", "",
                "give the log the camera's calibration, or choose another sensor");
  return lens;
}

// The median depth, in the picture's units, around a place on the horizon; 0 where nothing was measured.
std::uint16_t depth_at(const CObservation3DRangeScan& picture, const Lens& lens, int column) {
  const double half_rows = lens.fy * std::tan(kBand_rad);
  const int first = std::max(0, static_cast<int>(std::lround(lens.cy - half_rows)));
  const int last = std::min(lens.height - 1, static_cast<int>(std::lround(lens.cy + half_rows)));
  std::vector<std::uint16_t> depths;
  for (int row = first; row <= last; ++row)
    if (const std::uint16_t depth = picture.rangeImage(row, column); depth != 0) depths.push_back(depth);
  if (depths.empty()) return 0;
  return median(std::move(depths));
}

CObservation2DRangeScan::Ptr scan_of(const CObservation3DRangeScan& picture) {
  const Lens lens = lens_of(picture);
  // As far to the left as to the right, as a planar scan has it.
  const double half_rad = std::atan(std::min(lens.cx, lens.width - 1 - lens.cx) / lens.fx);
  const std::size_t rays = 2 + static_cast<std::size_t>(2.0 * half_rad / kRay_rad);
  const double step_rad = 2.0 * half_rad / static_cast<double>(rays - 1);
  auto scan = CObservation2DRangeScan::Create();
  scan->timestamp = picture.timestamp;
  scan->sensorLabel = picture.sensorLabel;
  scan->sensorPose = picture.sensorPose;
  scan->rightToLeft = true;
  scan->aperture = static_cast<float>(2.0 * half_rad);
  scan->maxRange = picture.maxRange;
  scan->resizeScan(rays);
  for (std::size_t ray = 0; ray < rays; ++ray) {
    const double angle = static_cast<double>(ray) * step_rad - half_rad;
    const auto column = static_cast<int>(std::lround(lens.cx - lens.fx * std::tan(angle)));
    const double depth_m =
        picture.rangeUnits * static_cast<double>(depth_at(picture, lens, std::clamp(column, 0, lens.width - 1)));
    scan->setScanRange(ray, static_cast<float>(picture.range_is_depth ? depth_m / std::cos(angle) : depth_m));
    scan->setScanRangeValidity(ray, depth_m > 0.0);
  }
  return scan;
}

class DepthScans : public rawlog::ObservationStream {
 public:
  explicit DepthScans(std::unique_ptr<rawlog::ObservationStream> log) : log_(std::move(log)) {}

  std::optional<rawlog::Record> next() override {
    while (auto record = log_->next()) {
      if (dynamic_cast<const CObservation2DRangeScan*>(record->observation.get()) != nullptr) continue;
      const auto* picture = dynamic_cast<const CObservation3DRangeScan*>(record->observation.get());
      if (picture == nullptr) return record;
      if (!picture->hasRangeImage) continue;
      has_depth_ = true;
      rawlog::load_pictures(*picture);
      return rawlog::Record{record->stamp, scan_of(*picture)};
    }
    if (!has_depth_)
      throw Error(ErrorCode::kBadInput, "there is no depth picture in the log", "",
                  "look at the log with: mapweave inspect LOG");
    return std::nullopt;
  }
  std::uint64_t bytes_read() const override { return log_->bytes_read(); }
  std::uint64_t bytes_total() const override { return log_->bytes_total(); }

 private:
  std::unique_ptr<rawlog::ObservationStream> log_;
  bool has_depth_ = false;
};

}  // namespace

std::unique_ptr<rawlog::ObservationStream> depth_scans(std::unique_ptr<rawlog::ObservationStream> log) {
  return std::make_unique<DepthScans>(std::move(log));
}

}  // namespace mapweave::laser
