#include <mapweave/evaluation/relations.h>

#include "number_lines.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/evaluation/statistics.h>

#include <algorithm>
#include <charconv>

namespace mapweave::evaluation {
namespace {

struct FoundPose {
  Pose2 world_from_robot;
  bool interpolated;
};

std::optional<FoundPose> pose_at(const Trajectory& trajectory, Stamp stamp, const RelationErrorOptions& options) {
  if (const auto* point = nearest_point(trajectory, stamp, options.stamp_tolerance_s))
    return FoundPose{planar(point->pose), false};
  if (const auto pose = interpolated_pose(trajectory, stamp, options.max_gap_s)) return FoundPose{planar(*pose), true};
  return std::nullopt;
}

struct FoundPair {
  FoundPose i, j;
  bool between_robots;
};

std::optional<FoundPair> poses_of(const Relation& relation, const std::vector<std::vector<Trajectory>>& maps,
                                  const RelationErrorOptions& options) {
  std::optional<FoundPair> between_robots;
  for (const std::vector<Trajectory>& robots : maps) {
    std::optional<FoundPose> first, second;
    for (const Trajectory& robot : robots) {
      const auto i = pose_at(robot, relation.stamp_i, options), j = pose_at(robot, relation.stamp_j, options);
      if (i && j) return FoundPair{*i, *j, false};
      if (!first) first = i;
      if (!second) second = j;
    }
    if (first && second && !between_robots) between_robots = FoundPair{*first, *second, true};
  }
  return between_robots;
}

std::string seconds_text(Stamp stamp) {
  char text[64];
  const auto end = std::to_chars(text, text + sizeof text, stamp.seconds(), std::chars_format::fixed, 3).ptr;
  return std::string(text, end);
}

[[noreturn]] void refuse_unusable(const std::vector<TeamRelations>& all) {
  std::vector<Stamp> stamps;
  std::string ranges;
  for (const TeamRelations& team : all) {
    for (const Relation& relation : team.relations) stamps.insert(stamps.end(), {relation.stamp_i, relation.stamp_j});
    for (const auto& robots : team.maps)
      for (const Trajectory& robot : robots)
        if (!robot.empty())
          ranges += (ranges.empty() ? "" : ", another one from ") + seconds_text(robot.front().stamp) + " to " +
                    seconds_text(robot.back().stamp);
  }
  if (stamps.empty() || ranges.empty())
    throw Error(ErrorCode::kBadInput, stamps.empty() ? "there are no relations" : "the trajectory is empty");
  const auto [first, last] = std::minmax_element(stamps.begin(), stamps.end());
  throw Error(ErrorCode::kBadInput,
              "none of the " + std::to_string(stamps.size() / 2) + " relations (stamps " + seconds_text(*first) +
                  " to " + seconds_text(*last) + ") has poses at both its stamps: the trajectory goes from " + ranges,
              {}, "give the relations of the same log, and a trajectory with one pose per scan");
}

}  // namespace

std::vector<Relation> parse_relations(std::string_view text, const std::string& where) {
  NumberLines lines(text, where, "t_i t_j x y z roll pitch yaw");
  std::vector<Relation> relations;
  while (lines.next()) {
    for (std::size_t unused = 4; unused < 7; ++unused) lines.number(unused);
    relations.push_back(
        {lines.stamp(0), lines.stamp(1), Pose2(lines.number(2), lines.number(3), wrap_angle(lines.number(7)))});
  }
  if (relations.empty())
    throw Error(ErrorCode::kBadInput, "no relation in it; expected lines of t_i t_j x y z roll pitch yaw", where);
  return relations;
}

std::vector<Relation> read_relations(const std::filesystem::path& path) {
  return parse_relations(read_file(path), path.string());
}

RelationError relation_error(const Trajectory& trajectory, const std::vector<Relation>& relations,
                             const RelationErrorOptions& options) {
  return relation_error(std::vector<TeamRelations>{{{{trajectory}}, relations}}, options);
}

RelationError relation_error(const std::vector<TeamRelations>& all, const RelationErrorOptions& options) {
  RelationError result;
  std::vector<double> translations_m, rotations_deg, translations_squared, rotations_squared;
  for (const TeamRelations& team : all) {
    result.count += team.relations.size();
    for (const Relation& relation : team.relations) {
      const auto found = poses_of(relation, team.maps, options);
      if (!found) continue;
      if (found->i.interpolated || found->j.interpolated) ++result.interpolated;
      if (found->between_robots) ++result.between_robots;
      const Pose2 i_from_j = between(compose(found->i.world_from_robot, options.robot_from_sensor),
                                     compose(found->j.world_from_robot, options.robot_from_sensor));
      const Pose2 error = between(relation.i_from_j, i_from_j);
      const double translation_m = std::hypot(error.x, error.y),
                   rotation_deg = std::abs(wrap_angle(error.phi)) * 180.0 / M_PI;
      translations_m.push_back(translation_m);
      rotations_deg.push_back(rotation_deg);
      translations_squared.push_back(translation_m * translation_m);
      rotations_squared.push_back(rotation_deg * rotation_deg);
    }
  }
  if (translations_m.empty()) refuse_unusable(all);

  result.used = translations_m.size();
  const Statistics translation = statistics_of(std::move(translations_m)),
                   rotation = statistics_of(std::move(rotations_deg));
  const Statistics translation_squared = statistics_of(std::move(translations_squared)),
                   rotation_squared = statistics_of(std::move(rotations_squared));
  result.translation_mean_m = translation.mean;
  result.translation_std_m = translation.std;
  result.translation_median_m = translation.median;
  result.translation_max_m = translation.max;
  result.rotation_mean_deg = rotation.mean;
  result.rotation_std_deg = rotation.std;
  result.rotation_median_deg = rotation.median;
  result.rotation_max_deg = rotation.max;
  result.translation_squared_mean = translation_squared.mean;
  result.translation_squared_std = translation_squared.std;
  result.rotation_squared_mean = rotation_squared.mean;
  result.rotation_squared_std = rotation_squared.std;
  return result;
}

}  // namespace mapweave::evaluation
