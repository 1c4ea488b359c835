// mapweave evaluate: numbers that judge a trajectory or a grid, and gates on them.

#include "command.h"
#include "gates.h"

#include <mapweave/core/error.h>
#include <mapweave/evaluation/absolute_error.h>
#include <mapweave/evaluation/grid_agreement.h>
#include <mapweave/evaluation/relations.h>
#include <mapweave/evaluation/tum_trajectory.h>
#include <mapweave/exporters/map_server.h>

#include <nlohmann/json.hpp>

#include <cmath>
#include <memory>

namespace mapweave::app {
namespace {

using Json = nlohmann::ordered_json;
namespace evaluation = ::mapweave::evaluation;

struct Arguments {
  std::string trajectory, relations, estimate, reference, grid_a, grid_b;
  std::vector<double> sensor;  // x, y, yaw
  evaluation::TrajectoryErrorOptions error;
  evaluation::RelativeErrorOptions relative;
  evaluation::GridAgreementOptions agreement;
  std::vector<std::string> limits;
  bool json = false;
};

Json relation_numbers(const Arguments& arguments) {
  evaluation::RelationErrorOptions options;
  if (!arguments.sensor.empty())
    options.robot_from_sensor = {arguments.sensor[0], arguments.sensor[1], arguments.sensor[2]};
  const auto error = evaluation::relation_error(evaluation::read_tum(arguments.trajectory),
                                                evaluation::read_relations(arguments.relations), options);
  return {{"count", error.count},
          {"used", error.used},
          {"interpolated", error.interpolated},
          {"translation_mean_m", error.translation_mean_m},
          {"translation_std_m", error.translation_std_m},
          {"translation_median_m", error.translation_median_m},
          {"translation_max_m", error.translation_max_m},
          {"rotation_mean_deg", error.rotation_mean_deg},
          {"rotation_std_deg", error.rotation_std_deg},
          {"rotation_median_deg", error.rotation_median_deg},
          {"rotation_max_deg", error.rotation_max_deg},
          {"translation_squared_mean", error.translation_squared_mean},
          {"translation_squared_std", error.translation_squared_std},
          {"rotation_squared_mean", error.rotation_squared_mean},
          {"rotation_squared_std", error.rotation_squared_std}};
}

void add_statistics(Json& numbers, const std::string& name, const std::string& unit,
                    const evaluation::Statistics& statistics) {
  numbers[name + "_rmse_" + unit] = statistics.rmse;
  numbers[name + "_mean_" + unit] = statistics.mean;
  numbers[name + "_median_" + unit] = statistics.median;
  numbers[name + "_std_" + unit] = statistics.std;
  numbers[name + "_max_" + unit] = statistics.max;
}

void check(const evaluation::RelativeErrorOptions& relative) {
  if (!(relative.delta > 0.0))
    throw Error(ErrorCode::kUsage, "the length of the pieces must be larger than 0", "--delta",
                "choose 1, for example");
  constexpr double kMostFrames = 1e9;
  if (relative.unit == evaluation::DeltaUnit::frames &&
      (relative.delta >= kMostFrames || relative.delta != std::floor(relative.delta)))
    throw Error(ErrorCode::kUsage, "frames are counted in whole numbers below 1e9", "--delta",
                "choose 1, or --delta-unit metres");
}

Json trajectory_numbers(const Arguments& arguments) {
  check(arguments.relative);
  const auto estimate = evaluation::read_tum(arguments.estimate), reference = evaluation::read_tum(arguments.reference);
  const auto absolute = evaluation::absolute_error(estimate, reference, arguments.error);
  const auto relative = evaluation::relative_error(estimate, reference, arguments.error, arguments.relative);
  Json numbers = {{"pairs", absolute.pairs}, {"scale", absolute.reference_from_estimate.scale}};
  add_statistics(numbers, "ate_translation", "m", absolute.translation_m);
  add_statistics(numbers, "ate_rotation", "deg", absolute.rotation_deg);
  add_statistics(numbers, "rpe_translation", "m", relative.translation_m);
  add_statistics(numbers, "rpe_rotation", "deg", relative.rotation_deg);
  return numbers;
}

Json grid_numbers(const Arguments& arguments) {
  const auto result = evaluation::grid_agreement(exporters::read_map_server(arguments.grid_a),
                                                 exporters::read_map_server(arguments.grid_b), arguments.agreement);
  return {{"resolution_m", result.resolution_m}, {"known_a_m2", result.known_a_m2}, {"known_b_m2", result.known_b_m2},
          {"common_m2", result.common_m2},       {"overlap", result.overlap},       {"agreement", result.agreement},
          {"conflict", result.conflict},         {"wall_iou", result.wall_iou}};
}

void add_output(CLI::App& judge, Arguments& arguments) {
  judge.add_option("--max", arguments.limits, "a gate: exit code 5 when the number KEY is larger than VALUE")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);
  judge.add_flag("--json", arguments.json, "print JSON");
}

}  // namespace

Action set_up_evaluate(CLI::App& verb) {
  const auto arguments = std::make_shared<Arguments>();
  verb.require_subcommand(1);

  CLI::App* relations =
      verb.add_subcommand("relations", "error of relative poses that people checked by hand (Kuemmerle et al. 2009)");
  relations->add_option("--trajectory", arguments->trajectory, "TUM file")->required()->type_name("T.tum");
  relations->add_option("--relations", arguments->relations, "t_i t_j x y z roll pitch yaw a line")
      ->required()
      ->type_name("R");
  relations
      ->add_option("--sensor", arguments->sensor,
                   "pose on the robot of the sensor that the relations speak of: metres and radians")
      ->delimiter(',')
      ->expected(3)
      ->type_name("X,Y,YAW");
  add_output(*relations, *arguments);

  CLI::App* trajectory =
      verb.add_subcommand("trajectory", "absolute and relative error against a reference (ATE, RPE)");
  trajectory->add_option("--estimate", arguments->estimate, "TUM file")->required()->type_name("E.tum");
  trajectory->add_option("--reference", arguments->reference, "TUM file")->required()->type_name("R.tum");
  using Kind = evaluation::AlignmentKind;
  trajectory->add_option("--align", arguments->error.align, "how the estimate is laid on the reference first")
      ->required()
      ->transform(CLI::CheckedTransformer(std::vector<std::pair<std::string, Kind>>{
          {"none", Kind::none}, {"se2", Kind::se2}, {"se3", Kind::se3}, {"sim3", Kind::sim3}}));
  trajectory
      ->add_option("--max-difference", arguments->error.max_stamp_difference_s,
                   "seconds between poses that belong together")
      ->capture_default_str();
  trajectory->add_option("--delta", arguments->relative.delta, "RPE: length of the pieces")->capture_default_str();
  using Unit = evaluation::DeltaUnit;
  trajectory->add_option("--delta-unit", arguments->relative.unit, "RPE: frames or metres")
      ->transform(CLI::CheckedTransformer(
          std::vector<std::pair<std::string, Unit>>{{"frames", Unit::frames}, {"metres", Unit::metres}}));
  trajectory->add_flag("--all-pairs", arguments->relative.all_pairs, "RPE: pieces from every pose");
  add_output(*trajectory, *arguments);

  CLI::App* grids = verb.add_subcommand("grids", "agreement and conflict of two grids of one frame");
  grids->add_option("A", arguments->grid_a, "map_server file")->required()->type_name("A.yaml");
  grids->add_option("B", arguments->grid_b, "map_server file")->required()->type_name("B.yaml");
  grids
      ->add_option("--wall-tolerance", arguments->agreement.wall_tolerance_cells,
                   "cells; a wall this near is the same wall")
      ->check(CLI::Range(0, 20))
      ->capture_default_str();
  add_output(*grids, *arguments);

  return [=] {
    const Json numbers = relations->parsed()    ? relation_numbers(*arguments)
                         : trajectory->parsed() ? trajectory_numbers(*arguments)
                                                : grid_numbers(*arguments);
    return report_numbers(numbers, arguments->json, arguments->limits);
  };
}

}  // namespace mapweave::app
