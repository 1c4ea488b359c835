#include "sensor_notes.h"

#include "pictures/detector.h"

#include <mapweave/core/median.h>

#include <cmath>
#include <sstream>

namespace mapweave::visual {
namespace {

constexpr int kNotedAfter = 10;  // frames

template <class... Parts>
std::string said(const Parts&... parts) {
  std::ostringstream text;
  text.precision(3);
  (text << ... << parts);
  return text.str();
}

int depths_in(const Frame& frame, const Pyramid& left, const LandmarkMap& map, const ClientOptions& options) {
  const DepthMeter meter(map, frame, left, Motion(), options);
  int count = 0;
  for (const Corner& corner : detect_corners(left, {}, {})) count += meter.at(corner.pixel, corner.level).has_value();
  return count;
}

std::string note_on_pair(const Frame& frame, const LandmarkMap& map, const ClientOptions& options) {
  Frame exchanged;
  exchanged.grey = frame.right;
  exchanged.right = frame.grey;
  if (depths_in(exchanged, make_pyramid(exchanged.grey), map, options) >= options.tracking.least_landmarks)
    return "the left and right pictures seem to be exchanged: what the one shows lies on the wrong side in the other; "
           "exchange them";
  return "hardly anything in the left pictures is found in the right ones: check that both are taken at once, and the "
         "calibration";
}

// Why no depths are known.
std::string note_on_depth(const Frame& frame, const LandmarkMap& map, const ClientOptions& options) {
  if (!frame.right.empty()) return note_on_pair(frame, map, options);
  std::vector<std::uint16_t> readings;
  for (const std::uint16_t value : frame.depth.image.pixels)
    if (value != 0) readings.push_back(value);
  if (readings.size() * 20 < frame.depth.image.pixels.size() || readings.empty())
    return "the depth pictures are all but empty, or missing: check the sensor";
  const double depth_m = median(std::move(readings)) * frame.depth.metres_per_unit;
  if (depth_m < options.depth.min_depth_m || depth_m > options.depth.max_depth_m)
    return said("the depth pictures read ", depth_m, " m in the middle, where ", options.depth.min_depth_m, " to ",
                options.depth.max_depth_m, " m are used: check the depth scale (", frame.depth.metres_per_unit,
                " m per unit now)");
  return "the depth pictures do not fit what the others show: check that both are of one camera, and the calibration";
}

std::string note_on_delay(double delay_s) {
  return said("the depth pictures are taken ", std::abs(delay_s), " s ", delay_s > 0 ? "after" : "before",
              " the others and not used: check the stamps");
}

}  // namespace

void SensorNotes::look_at(const Frame& frame) {
  if (noted_delay_ || frame.depth.image.empty() || !(std::abs(frame.depth.delay_s) > kLongestInterval_s)) return;
  notes_.push_back(note_on_delay(frame.depth.delay_s));
  noted_delay_ = true;
}

void SensorNotes::miss_depth(const Frame& frame, const LandmarkMap& map, const ClientOptions& options) {
  if (++without_depth_ == kNotedAfter) notes_.push_back(note_on_depth(frame, map, options));
}

}  // namespace mapweave::visual
