#include "reference_errors.h"

#include <mapweave/core/error.h>
#include <mapweave/core/format.h>
#include <mapweave/evaluation/absolute_error.h>
#include <mapweave/evaluation/tum_trajectory.h>

#include <algorithm>
#include <cmath>

namespace mapweave::report {
namespace {

namespace fs = std::filesystem;
using evaluation::PosePair;

constexpr double kMostApart_s = 0.01;
constexpr std::size_t kMostErrorsShown = 400;  // along time, of a robot

struct Compared {
  const RobotTrajectory* estimate;
  evaluation::Trajectory reference;
  std::vector<PosePair> pairs;
};

// Where the reference of a robot is; empty: there is none.
fs::path file_of(const fs::path& reference, const std::string& robot, std::size_t robots) {
  std::error_code ignored;
  if (!fs::is_directory(reference, ignored)) {
    if (!fs::exists(reference, ignored))
      throw Error(ErrorCode::kMissing, "there is no such reference", reference.string());
    if (robots > 1)
      throw Error(ErrorCode::kUsage, "one reference is given, and there are several robots", reference.string(),
                  "give a folder with a file <robot>.tum for each");
    return reference;
  }
  for (const char* ending : {".tum", ".truth.tum", "/trajectory.tum"})
    if (fs::exists(reference / (robot + ending), ignored)) return reference / (robot + ending);
  return {};
}

bool is_planar(const std::vector<Compared>& all) {
  return std::all_of(all.begin(), all.end(), [](const Compared& one) {
    return std::all_of(one.pairs.begin(), one.pairs.end(),
                       [](const PosePair& pair) { return std::abs(pair.estimate.t.z()) < 1e-6; });
  });
}

Json error_json(const std::string& robot, const Compared& one, const Sim3& reference_from_estimate) {
  std::vector<double> off_m;
  for (const PosePair& pair : one.pairs)
    off_m.push_back((pair.reference.t - transformed(pair.estimate, reference_from_estimate).t).norm());
  Json t = Json::array(), off = Json::array();
  const std::size_t count = std::min(off_m.size(), kMostErrorsShown);
  std::int64_t before_ms = 0;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t place = i * off_m.size() / count;
    const auto now_ms = std::llround(1e3 * seconds_between(one.pairs.front().stamp, one.pairs[place].stamp));
    t.push_back(now_ms - before_ms);
    off.push_back(std::llround(1e3 * off_m[place]));
    before_ms = now_ms;
  }
  const evaluation::Statistics ate = evaluation::statistics_of(off_m);
  Json json = {{"robot", robot},
               {"pairs", one.pairs.size()},
               {"poses", one.estimate->poses.size()},
               {"ate_rmse_m", ate.rmse},
               {"ate_median_m", ate.median},
               {"ate_max_m", ate.max},
               {"t_ms", t},
               {"off_mm", off}};
  evaluation::TrajectoryErrorOptions options;
  options.align = evaluation::AlignmentKind::none;
  options.max_stamp_difference_s = kMostApart_s;
  try {
    const auto relative = evaluation::relative_error(one.estimate->poses, one.reference, options);
    json["rpe_rmse_m"] = relative.translation_m.rmse;
    json["rpe_rmse_deg"] = relative.rotation_deg.rmse;
  } catch (const Error&) {  // fewer than two poses that belong together
  }
  return json;
}

// The reference in the map's frame.
RobotTrajectory moved(const Compared& one, const Sim3& reference_from_estimate) {
  const Sim3& motion = reference_from_estimate;
  const Pose3 back = inverse(motion.pose);
  RobotTrajectory result{one.estimate->robot, one.reference};
  for (evaluation::TrajectoryPoint& point : result.poses) point.pose = compose(back, point.pose);
  return result;
}

}  // namespace

ReferenceErrors reference_errors(const fs::path& reference, const std::vector<std::string>& robots,
                                 std::vector<ReportMap>& maps) {
  ReferenceErrors result;
  if (reference.empty()) return result;
  if (maps.empty()) throw Error(ErrorCode::kMissing, "there is no trajectory to compare", reference.string());
  std::vector<Compared> all;
  for (const RobotTrajectory& estimate : maps.front().trajectories) {
    const std::string& robot = robots.at(estimate.robot);
    const fs::path file = file_of(reference, robot, robots.size());
    Compared one{&estimate, file.empty() ? evaluation::Trajectory() : evaluation::read_tum(file), {}};
    one.pairs = evaluation::associated(estimate.poses, one.reference, kMostApart_s);
    if (one.pairs.empty())
      result.errors.push_back({{"robot", robot}, {"problem", file.empty() ? "no reference" : "no stamps in common"}});
    else
      all.push_back(std::move(one));
  }
  if (all.empty())
    throw Error(ErrorCode::kMissing, "no robot has a reference with stamps in common", reference.string(),
                "name the files <robot>.tum, with stamps of the robot's log");
  std::vector<PosePair> pairs;
  for (const Compared& one : all) pairs.insert(pairs.end(), one.pairs.begin(), one.pairs.end());
  const bool planar = is_planar(all);
  const Sim3 motion = evaluation::reference_from_estimate(
      pairs, planar ? evaluation::AlignmentKind::se2 : evaluation::AlignmentKind::se3);
  for (const Compared& one : all) {
    result.errors.push_back(error_json(robots.at(one.estimate->robot), one, motion));
    maps.front().references.push_back(moved(one, motion));
  }
  result.alignment = format("Trajectories of %s, all laid on their references by one motion (%s).",
                            maps.front().title.c_str(), planar ? "x, y, yaw" : "rigid, in space");
  return result;
}

}  // namespace mapweave::report
