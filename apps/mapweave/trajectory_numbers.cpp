#include "trajectory_numbers.h"

#include <mapweave/core/error.h>
#include <mapweave/evaluation/drift.h>

#include <algorithm>
#include <cmath>
#include <sstream>

namespace mapweave::app {
namespace {

using Json = nlohmann::ordered_json;
using evaluation::AlignedTracks;
using evaluation::AlignmentKind;
using evaluation::Trajectory;

void add_statistics(Json& numbers, const std::string& name, const std::string& unit,
                    const evaluation::Statistics& statistics) {
  numbers[name + "_rmse_" + unit] = statistics.rmse;
  numbers[name + "_mean_" + unit] = statistics.mean;
  numbers[name + "_median_" + unit] = statistics.median;
  numbers[name + "_std_" + unit] = statistics.std;
  numbers[name + "_max_" + unit] = statistics.max;
}

void add_drift(Json& numbers, const AlignedTracks& tracks) {
  const evaluation::Drift drift = evaluation::drift(tracks.tracks);
  if (drift.all.pieces == 0) return;
  numbers["drift_translation_percent"] = drift.all.translation_percent;
  numbers["drift_rotation_deg_per_m"] = drift.all.rotation_deg_per_m;
  for (const evaluation::LengthDrift& length : drift.by_length) {
    if (length.pieces == 0) continue;
    const std::string name = "drift_" + std::to_string(std::lround(length.length_m)) + "m_";
    numbers[name + "translation_percent"] = length.translation_percent;
    numbers[name + "rotation_deg_per_m"] = length.rotation_deg_per_m;
  }
}

Json numbers_of(const AlignedTracks& tracks, const evaluation::RelativeErrorOptions& options) {
  const auto absolute = evaluation::absolute_error(tracks);
  const auto relative = evaluation::relative_error(tracks, options);
  Json numbers = {{"pairs", absolute.pairs}, {"scale", absolute.reference_from_estimate.scale}};
  add_statistics(numbers, "ate_translation", "m", absolute.translation_m);
  add_statistics(numbers, "ate_rotation", "deg", absolute.rotation_deg);
  add_statistics(numbers, "rpe_translation", "m", relative.translation_m);
  add_statistics(numbers, "rpe_rotation", "deg", relative.rotation_deg);
  add_drift(numbers, tracks);
  return numbers;
}

bool is_planar(const Trajectory& trajectory) {
  return std::all_of(trajectory.begin(), trajectory.end(), [&](const auto& point) {
    return point.pose.t.z() == trajectory.front().pose.t.z() && point.pose.q.x() == 0.0 && point.pose.q.y() == 0.0;
  });
}

AlignmentKind alignment_for(const std::vector<evaluation::Compared>& compared) {
  const bool planar = std::any_of(compared.begin(), compared.end(), [](const evaluation::Compared& one) {
    return is_planar(one.estimate) || is_planar(one.reference);
  });
  return planar ? AlignmentKind::se2 : AlignmentKind::se3;
}

std::string degrees(double value) {
  std::ostringstream text;
  text.precision(value < 10.0 ? 2 : 4);
  text << value << " deg";
  return text.str();
}

// What a constant rotation means, and what to do about it.
std::string rotation_note(const std::string& who, const evaluation::ConstantRotation& found, bool is_removed) {
  constexpr double kLike_rad = 0.35;
  const Eigen::Quaterniond optical = evaluation::robot_from_optical().q;
  std::string note = who + "is turned by " + degrees(found.angle_deg) + " against the reference all the way (spread " +
                     degrees(found.spread_deg) + "): they follow different bodies";
  if (found.reference_body_from_estimate_body.angularDistance(optical.conjugate()) < kLike_rad)
    note += ", as a robot and its camera's optical frame do; evaluate trajectory.optical.tum, or give --sensor optical";
  else if (found.reference_body_from_estimate_body.angularDistance(optical) < kLike_rad)
    note += ", as a camera's optical frame and its robot do; evaluate trajectory.robot.tum";
  else
    note += "; --sensor says how the reference's body stands on the estimate's";
  return note + (is_removed ? ". The rotation was removed" : ". --extrinsics auto removes the rotation");
}

std::vector<evaluation::Compared> with_references(const std::vector<EvaluatedRobot>& robots,
                                                  const TrajectoryJudging& judging) {
  std::vector<evaluation::Compared> result;
  for (const EvaluatedRobot& robot : robots) {
    const auto file = reference_of(judging.reference, robot.robot);
    const evaluation::TrajectoryFile reference = evaluation::read_trajectory(file, judging.times);
    if (reference.has_stamps != robot.estimate.has_stamps)
      throw Error(ErrorCode::kMissing, "poses of KITTI have no stamps",
                  reference.has_stamps ? robot.file.string() : file.string(),
                  "put their times.txt beside them, or name it: --times FILE");
    Trajectory estimate = robot.estimate.trajectory;
    for (auto& point : estimate) point.pose = compose(point.pose, judging.robot_from_sensor);
    result.push_back({std::move(estimate), reference.trajectory});
  }
  return result;
}

// Says which of several runs it is that cannot be aligned.
AlignedTracks aligned(const EvaluatedRun& run, const std::vector<evaluation::Compared>& compared,
                      const evaluation::TrajectoryErrorOptions& options) {
  try {
    return evaluation::aligned_tracks(compared, options);
  } catch (const Error& error) {
    throw Error(error.code(), error.problem(), error.where().empty() ? run.name : error.where(), error.remedy());
  }
}

// The part of the estimate's time between its first and its last pose that has a reference.
double covered(const std::vector<evaluation::Compared>& compared, const AlignedTracks& tracks) {
  double matched_s = 0.0, whole_s = 0.0;
  for (std::size_t i = 0; i < compared.size(); ++i) {
    matched_s += seconds_between(tracks.tracks[i].front().stamp, tracks.tracks[i].back().stamp);
    whole_s += seconds_between(compared[i].estimate.front().stamp, compared[i].estimate.back().stamp);
  }
  return whole_s > 0.0 ? matched_s / whole_s : 1.0;
}

exporters::PlottedTrack plotted(const std::string& name, const std::vector<evaluation::PosePair>& track) {
  exporters::PlottedTrack result{name, {}};
  for (const auto& pair : track) result.poses.push_back({pair.stamp.seconds(), pair.estimate.t, pair.reference.t});
  return result;
}

}  // namespace

JudgedRun judged(const EvaluatedRun& given, const TrajectoryJudging& judging) {
  constexpr double kMuch = 0.9;  // of the way has a reference
  const EvaluatedRun run = meant_by(given, judging.reference);
  JudgedRun result{run.name, {}, {}, {}, {}};
  AlignedTracks all;
  std::vector<evaluation::Compared> compared;
  double rotation_deg = 0.0;
  for (const auto& robots : run.maps) {
    std::vector<evaluation::Compared> map = with_references(robots, judging);
    evaluation::TrajectoryErrorOptions options = judging.error;
    options.align = judging.align ? *judging.align : alignment_for(map);
    AlignedTracks tracks = aligned(run, map, options);
    for (std::size_t i = 0; i < robots.size(); ++i) {
      const std::string& robot = robots[i].robot;
      auto& track = tracks.tracks[i];
      const bool is_aligned = options.align != AlignmentKind::none;
      if (const auto rotation = is_aligned ? evaluation::constant_rotation(track) : std::nullopt) {
        rotation_deg = std::max(rotation_deg, rotation->angle_deg);
        result.notes.push_back(rotation_note(robot.empty() ? "the estimate " : "robot " + robot + " ", *rotation,
                                             judging.removes_rotation));
        const Eigen::Quaterniond back = rotation->reference_body_from_estimate_body.conjugate();
        for (auto& pair : track)
          if (judging.removes_rotation) pair.estimate.q = (pair.estimate.q * back).normalized();
      }
      if (run.is_team())
        result.robots.emplace_back(robot, numbers_of({{track}, tracks.reference_from_estimate}, judging.relative));
      result.tracks.push_back(plotted(robot, track));
    }
    all.reference_from_estimate = tracks.reference_from_estimate;
    std::move(tracks.tracks.begin(), tracks.tracks.end(), std::back_inserter(all.tracks));
    std::move(map.begin(), map.end(), std::back_inserter(compared));
  }
  result.numbers = numbers_of(all, judging.relative);
  result.numbers["covered"] = covered(compared, all);
  if (rotation_deg > 0.0) result.numbers["constant_rotation_deg"] = rotation_deg;
  if (run.maps.size() > 1)
    result.notes.push_back("the robots are in " + std::to_string(run.maps.size()) +
                           " maps that stayed apart; each was aligned by itself");
  if (result.numbers["covered"].get<double>() < kMuch)
    result.notes.push_back("the reference covers " +
                           std::to_string(std::lround(100.0 * result.numbers["covered"].get<double>())) +
                           " % of the time; nothing is said of the rest");
  return result;
}

Pose3 sensor_pose(const std::string& text) {
  if (text.empty()) return {};
  if (text == "optical") return evaluation::robot_from_optical();
  std::vector<double> numbers;
  std::istringstream stream(text);
  bool is_readable = true;
  for (std::string word; std::getline(stream, word, ',');) {
    std::istringstream number(word);
    is_readable = (number >> numbers.emplace_back()) && number.peek() == EOF && is_readable;
  }
  if (is_readable && numbers.size() == 3) return spatial(Pose2(numbers[0], numbers[1], numbers[2]));
  if (is_readable && numbers.size() == 7) {
    const Eigen::Quaterniond q(numbers[6], numbers[3], numbers[4], numbers[5]);
    if (std::abs(q.norm() - 1.0) < 1e-2) return {{numbers[0], numbers[1], numbers[2]}, q.normalized()};
  }
  throw Error(
      ErrorCode::kUsage, "'" + text + "' is no pose of a sensor on its robot", "--sensor",
      "write X,Y,YAW, or X,Y,Z,QX,QY,QZ,QW with a quaternion of length 1, or optical: a camera that looks ahead");
}

}  // namespace mapweave::app
