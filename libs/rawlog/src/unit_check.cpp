#include <mapweave/core/geometry.h>
#include <mapweave/rawlog/unit_check.h>
#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/obs/CObservation3DRangeScan.h>
#include <mrpt/obs/CObservationOdometry.h>
#include <mrpt/obs/CObservationStereoImages.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <optional>
#include <utility>

namespace mapweave::rawlog {
namespace {

constexpr std::uint64_t kBeginning = 3000;  // records: bounds the time of recordings that never have enough to judge
// Of a sensor, after which it is judged. A wrong unit shows in each of them by itself; more of them outvote a start
// right before a wall, a hand before the camera or a jump of the odometry.
constexpr std::size_t kScans = 20, kPictures = 10, kSteps = 40;
// Fewer are not judged, where a recording ends before: a quantile of them is one reading or two.
constexpr std::size_t kFewestReadings = 100, kFewestSteps = 10;
constexpr std::size_t kFewestDistinct = 20;  // readings: what lasers answer instead of a distance is a value or a few
// Neighbours see the same. The pixels' number divides no usual width, so that they lie in all columns.
constexpr std::size_t kRaysApart = 4;
constexpr std::ptrdiff_t kPixelsApart = 17;

constexpr double kFarthestReading_m = 200.0;  // no planar laser reaches farther
constexpr double kFarMiddle_m = 100.0;        // nor sees so far with half of its rays
constexpr double kLeastUsable = 0.02;         // of the readings: with fewer, nothing is left to be mapped
constexpr double kLargestFan_rad = 6.4;       // a full turn, and a ray more
// In centimetres a robot of 0.2 m/s is as fast, in degrees a turn of 5 degrees a second.
constexpr double kFastest_mps = 20.0, kFastestTurn_rad_s = 5.0;
constexpr double kMostSteps = 0.8;  // of the steps are slower than the speed that is judged: the others may be jumps
// Of a step: stamps are rounded, so that shorter ones have any speed; longer ones span a gap. Turns are known but for
// whole circles, so that only steps below 0.63 s can show more than kFastestTurn_rad_s; smaller turns are noise.
constexpr double kShortestStep_s = 0.02, kLongestStep_s = 2.0, kLongestTurn_s = 0.5, kLeastTurn_rad = 0.01;
constexpr double kCloseReading_m = 0.1;  // no planar laser sees nothing but what is nearer
// Depth cameras see no farther and nothing nearer than the first two. Where 19 of 20 pixels of a picture are nearer
// than the third, the scale makes the world too small; between the third and the fourth is a room's usual depth.
constexpr double kFarDepth_m = 10.0, kNearDepth_m = 0.25, kShallow_m = 0.8, kUsualDepth_m = 7.0;
constexpr double kNoneNearer_m = 2.5;      // seldom: a depth camera that has neither floor nor table before it
constexpr double kWidestBaseline_m = 3.0;  // no pair on a robot is wider; in centimetres, hardly one is narrower

std::string text(const char* form, double value) {
  char result[64];
  std::snprintf(result, sizeof result, form, value);
  return result;
}

template <class Number>
double quantile(std::vector<Number> values, double share) {
  const auto place = values.begin() + static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), place, values.end());
  return static_cast<double>(*place);
}

// Lasers answer one value where nothing came back, which may be any number. Distances differ.
bool are_distances(std::vector<float> readings) {
  std::sort(readings.begin(), readings.end());
  std::size_t distinct = 0, most = 0;
  for (auto begin = readings.begin(); begin != readings.end(); ++distinct) {
    const auto end = std::upper_bound(begin, readings.end(), *begin);
    most = std::max(most, static_cast<std::size_t>(end - begin));
    begin = end;
  }
  return distinct >= kFewestDistinct && 2 * most < readings.size();
}

// Half of the ranges would be below 1 m where numbers below the first bound were millimetres, and above 50 m where
// those above the second one were centimetres.
std::string unit_of(double middle_m) {
  if (middle_m < 10.0 * kFarMiddle_m) return "are they in centimetres?";
  return middle_m < 50.0 * kFarMiddle_m ? "are they in millimetres, or in centimetres?" : "are they in millimetres?";
}

// One laser's scans.
class ScanUnits {
 public:
  std::optional<UnitDoubt> add(const mrpt::obs::CObservation2DRangeScan& scan) {
    if (scans_ == 0 && scan.aperture > kLargestFan_rad) {
      scans_ = kScans;
      return UnitDoubt{"the field of view of laser '" + scan.sensorLabel + "' is " + text("%g", scan.aperture) +
                           " rad, and a full turn 6.28",
                       "are its angles in degrees?", true};
    }
    if (scans_ == kScans) return std::nullopt;
    const double farthest_m =
        scan.maxRange > 0.0f ? std::min<double>(scan.maxRange, kFarthestReading_m) : kFarthestReading_m;
    const std::size_t before = readings_.size();
    for (std::size_t ray = 0; ray < scan.getScanSize(); ray += kRaysApart) {
      const float reading = scan.getScanRange(ray);
      if (!(reading > 0.0f) || !std::isfinite(reading)) continue;
      readings_.push_back(reading);
      usable_ += scan.getScanRangeValidity(ray) && reading < farthest_m;
    }
    if (readings_.size() == before || ++scans_ < kScans) return std::nullopt;
    return conclude(scan.sensorLabel);
  }
  std::optional<UnitDoubt> finish(const std::string& label) { return scans_ < kScans ? conclude(label) : std::nullopt; }

 private:
  std::optional<UnitDoubt> conclude(const std::string& label) {
    scans_ = kScans;
    const std::vector<float> readings = std::exchange(readings_, {});
    if (readings.size() < kFewestReadings) return std::nullopt;
    if (quantile(readings, 0.9) < kCloseReading_m && are_distances(readings))
      return UnitDoubt{
          "nine in ten readings of laser '" + label + "' are nearer than " + text("%.2g", kCloseReading_m) + " m",
          "are they in kilometres?", true};
    // A quarter of the readings may be of walls beside the robot, but in metres not three quarters of a hall's far end.
    const double middle_m = quantile(readings, 0.5);
    if (middle_m < kFarMiddle_m || quantile(readings, 0.25) < 0.25 * kFarMiddle_m || !are_distances(readings))
      return std::nullopt;
    return UnitDoubt{"half of the readings of laser '" + label + "' are farther than " + text("%.0f", middle_m) +
                         " m, and planar lasers reach " + text("%.0f", kFarthestReading_m) + " m at most",
                     unit_of(middle_m),
                     static_cast<double>(usable_) < kLeastUsable * static_cast<double>(readings.size())};
  }

  std::size_t scans_ = 0, usable_ = 0;
  std::vector<float> readings_;  // metres; of some rays
};

// One source of odometry.
class StepUnits {
 public:
  void add(const mrpt::obs::CObservationOdometry& odometry, Stamp stamp) {
    const auto& pose = odometry.odometry;
    const double seconds = before_ ? seconds_between(*before_, stamp) : kLongestStep_s;
    if (seconds < kShortestStep_s) return;  // measured together with the next one
    const double moved_m = std::hypot(pose.x() - x_m_, pose.y() - y_m_),
                 turned_rad = std::abs(wrap_angle(pose.phi() - heading_rad_));
    if (before_ && seconds <= kLongestStep_s && moved_m > 0.0) speeds_mps_.push_back(moved_m / seconds);
    if (before_ && seconds <= kLongestTurn_s && turned_rad > kLeastTurn_rad)
      turn_rates_rad_s_.push_back(turned_rad / seconds);
    before_ = stamp;
    x_m_ = pose.x();
    y_m_ = pose.y();
    heading_rad_ = pose.phi();
  }
  // Once there are `steps` of a kind, and once alone.
  std::vector<UnitDoubt> conclude(std::size_t steps) {
    std::vector<UnitDoubt> doubts;
    if (!speed_is_judged_ && speeds_mps_.size() >= steps) {
      speed_is_judged_ = true;
      const double speed_mps = quantile(speeds_mps_, kMostSteps);
      // In centimetres, ten times that would be 2 m/s and more.
      if (speed_mps > kFastest_mps)
        doubts.push_back(
            {"the odometry moves at " + text("%.0f", speed_mps) + " m/s and faster",
             speed_mps > 10.0 * kFastest_mps ? "is it in millimetres?" : "is it in centimetres, or in millimetres?"});
    }
    if (!turn_is_judged_ && turn_rates_rad_s_.size() >= steps) {
      turn_is_judged_ = true;
      const double rate_rad_s = quantile(turn_rates_rad_s_, kMostSteps);
      if (rate_rad_s > kFastestTurn_rad_s)
        doubts.push_back({"the odometry turns at " + text("%.1f", rate_rad_s) + " rad/s and faster",
                          "are its headings in degrees?"});
    }
    return doubts;
  }

 private:
  std::optional<Stamp> before_;
  double x_m_ = 0.0, y_m_ = 0.0, heading_rad_ = 0.0;
  std::vector<double> speeds_mps_, turn_rates_rad_s_;  // of steps that moved, or turned
  bool speed_is_judged_ = false, turn_is_judged_ = false;
};

// One depth camera's pictures.
class DepthUnits {
 public:
  std::optional<UnitDoubt> add(const mrpt::obs::CObservation3DRangeScan& picture) {
    if (pictures_ == kPictures || !picture.hasRangeImage || !(picture.rangeUnits > 0.0f)) return std::nullopt;
    std::vector<std::uint16_t> steps;
    const auto pixels = static_cast<std::ptrdiff_t>(picture.rangeImage.size());
    for (std::ptrdiff_t i = 0; i < pixels; i += kPixelsApart)
      if (const std::uint16_t depth = picture.rangeImage.data()[i]; depth != 0) steps.push_back(depth);
    if (steps.size() < kFewestReadings) return std::nullopt;
    steps_per_m_ = 1.0 / static_cast<double>(picture.rangeUnits);
    near_m_.push_back(quantile(steps, 0.05) / steps_per_m_);
    far_m_.push_back(quantile(steps, 0.95) / steps_per_m_);
    return ++pictures_ < kPictures ? std::nullopt : conclude(picture.sensorLabel);
  }
  std::optional<UnitDoubt> finish(const std::string& label) {
    return pictures_ > 0 && pictures_ < kPictures ? conclude(label) : std::nullopt;
  }

 private:
  std::optional<UnitDoubt> conclude(const std::string& label) {
    pictures_ = kPictures;
    const double near_m = quantile(near_m_, 0.5), far_m = quantile(far_m_, 0.5);
    const bool is_far = far_m > kFarDepth_m, is_near = near_m < kNearDepth_m && far_m < kShallow_m;
    std::string likelier_scale;
    for (const double likelier : {5000.0, 1000.0}) {
      const double as_m = far_m * steps_per_m_ / likelier;
      if (std::abs(likelier - steps_per_m_) > 1.0 && as_m > kShallow_m && as_m < kUsualDepth_m)
        likelier_scale = "is it " + text("%g", likelier) + (likelier == 5000.0 ? " (TUM RGB-D)?" : " (millimetres)?");
    }
    const bool has_nothing_near = near_m > kNoneNearer_m && !likelier_scale.empty();
    if (!is_far && !is_near && !has_nothing_near) return std::nullopt;
    const std::string guess = likelier_scale.empty() ? "how many steps has a metre?" : likelier_scale;
    return UnitDoubt{
        "with a depth scale of " + text("%.6g", steps_per_m_) + " steps to the metre, depth camera '" + label +
            "' sees " + text("%.2f", near_m) + " to " + text("%.2f", far_m) + " m far, and depth cameras " +
            (is_far    ? "see about " + text("%.0f", kFarDepth_m) + " m at most"
             : is_near ? "see nothing nearer than about " + text("%.2f", kNearDepth_m) + " m"
                       : "mostly have something nearer than " + text("%.1f", kNoneNearer_m) + " m before them"),
        guess};
  }

  std::size_t pictures_ = 0;
  double steps_per_m_ = 1.0;
  std::vector<double> near_m_, far_m_;  // of each picture: 5 and 95 percent lie nearer
};

class StereoUnits {
 public:
  std::optional<UnitDoubt> add(const mrpt::obs::CObservationStereoImages& pair) {
    const double baseline_m = pair.rightCameraPose.norm();
    if (std::exchange(is_judged_, true) || baseline_m < kWidestBaseline_m) return std::nullopt;
    // Below ten times that: 30 cm, or in millimetres 3 cm.
    return UnitDoubt{
        "the cameras of stereo pair '" + pair.sensorLabel + "' are " + text("%g", baseline_m) + " m apart",
        baseline_m < 10.0 * kWidestBaseline_m ? "is the baseline in centimetres?" : "is the baseline in millimetres?"};
  }

 private:
  bool is_judged_ = false;
};

}  // namespace

struct UnitCheck::State {
  std::uint64_t records = 0;
  std::map<std::string, ScanUnits> lasers;  // all by label
  std::map<std::string, StepUnits> odometries;
  std::map<std::string, DepthUnits> depth_cameras;
  std::map<std::string, StereoUnits> stereo_pairs;
};

UnitCheck::UnitCheck() : state_(new State) {}
UnitCheck::~UnitCheck() = default;
UnitCheck::UnitCheck(UnitCheck&&) noexcept = default;

std::vector<UnitDoubt> UnitCheck::add(const Record& record) {
  if (state_->records >= kBeginning) return {};
  if (++state_->records == kBeginning) return finish();
  std::vector<UnitDoubt> doubts;
  const auto take = [&](std::optional<UnitDoubt> doubt) {
    if (doubt) doubts.push_back(std::move(*doubt));
  };
  const mrpt::obs::CObservation& seen = *record.observation;
  if (const auto* scan = dynamic_cast<const mrpt::obs::CObservation2DRangeScan*>(&seen)) {
    take(state_->lasers[seen.sensorLabel].add(*scan));
  } else if (const auto* odometry = dynamic_cast<const mrpt::obs::CObservationOdometry*>(&seen)) {
    StepUnits& steps = state_->odometries[seen.sensorLabel];
    steps.add(*odometry, record.stamp);
    doubts = steps.conclude(kSteps);
  } else if (const auto* picture = dynamic_cast<const mrpt::obs::CObservation3DRangeScan*>(&seen)) {
    take(state_->depth_cameras[seen.sensorLabel].add(*picture));
  } else if (const auto* pair = dynamic_cast<const mrpt::obs::CObservationStereoImages*>(&seen)) {
    take(state_->stereo_pairs[seen.sensorLabel].add(*pair));
  }
  return doubts;
}

std::vector<UnitDoubt> UnitCheck::finish() {
  state_->records = kBeginning;
  std::vector<UnitDoubt> doubts;
  for (auto& [label, laser] : state_->lasers)
    if (auto doubt = laser.finish(label)) doubts.push_back(std::move(*doubt));
  for (auto& [label, camera] : state_->depth_cameras)
    if (auto doubt = camera.finish(label)) doubts.push_back(std::move(*doubt));
  for (auto& [label, odometry] : state_->odometries)
    for (UnitDoubt& doubt : odometry.conclude(kFewestSteps)) doubts.push_back(std::move(doubt));
  return doubts;
}

}  // namespace mapweave::rawlog
