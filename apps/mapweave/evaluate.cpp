// mapweave evaluate: numbers that judge trajectories and grids, and gates on them.

#include "command.h"
#include "command_line.h"
#include "evaluated_runs.h"
#include "gates.h"
#include "grid_alignment.h"
#include "output_file.h"
#include "trajectory_conversion.h"
#include "trajectory_numbers.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/core/log.h>
#include <mapweave/evaluation/grid_agreement.h>
#include <mapweave/exporters/map_server.h>

#include <cmath>
#include <memory>

namespace mapweave::app {
namespace {

using Json = nlohmann::ordered_json;
namespace evaluation = ::mapweave::evaluation;

struct Output {
  std::vector<std::string> limits;
  bool json = false;
};

void add_output(CLI::App& judge, Output& output) {
  judge.add_option("--max", output.limits, "a gate: exit code 5 when the number KEY is larger than VALUE")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);
  judge.add_flag("--json", output.json, "print JSON");
}

// What a judge is given: estimates and one reference, by position or by their flags.
struct Given {
  std::vector<std::string> files;
  std::string estimate, reference;

  void add_to(CLI::App& judge, const std::string& estimate_flag, const std::string& reference_flag) {
    judge.add_option("FILES", files, "estimates, then " + reference_flag.substr(2) + "; files, or folders of results")
        ->type_name("EST... REF");
    judge.add_option(estimate_flag, estimate, "the estimate, or a team's folder of results")->type_name("EST");
    judge
        .add_option(reference_flag, reference, "what it is compared with: a file, or a folder with one for each robot")
        ->type_name("REF");
  }
  // Takes the files apart. Throws Error(kUsage) where something is missing.
  std::vector<EvaluatedRun> take(const std::string& judge, const std::filesystem::path& times) {
    std::vector<std::string> estimates = files;
    if (!estimate.empty()) estimates.insert(estimates.begin(), estimate);
    if (reference.empty() && !estimates.empty() && !files.empty()) {
      reference = estimates.back();
      estimates.pop_back();
    }
    if (estimates.empty() || reference.empty())
      throw Error(ErrorCode::kUsage, estimates.empty() ? "there is no estimate" : "there is no reference", {},
                  "write: mapweave evaluate " + judge + " ESTIMATE REFERENCE");
    std::vector<EvaluatedRun> runs;
    for (const std::string& file : estimates) runs.push_back(read_run(file, times));
    return runs;
  }
};

// --- relations ---

struct RelationArguments {
  Given given;
  std::string sensor;
  Output output;
};

Json numbers_of(const evaluation::RelationError& error, bool is_team) {
  Json numbers = {{"count", error.count}, {"used", error.used}, {"interpolated", error.interpolated}};
  if (is_team) numbers["between_robots"] = error.between_robots;
  numbers.update({{"translation_mean_m", error.translation_mean_m},
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
                  {"rotation_squared_std", error.rotation_squared_std}});
  return numbers;
}

// Rows of a run: of a team's robots, and of all together.
std::vector<NumberRow> relation_rows(const EvaluatedRun& run, const std::string& reference,
                                     const evaluation::RelationErrorOptions& options) {
  std::error_code ignored;
  const bool has_one_each = std::filesystem::is_directory(reference, ignored);
  std::vector<NumberRow> rows;
  std::vector<evaluation::TeamRelations> together;
  if (!has_one_each) together.push_back({{}, evaluation::read_relations(reference)});
  for (const auto& robots : run.maps) {
    std::vector<evaluation::Trajectory> of_map;
    for (const EvaluatedRobot& robot : robots) {
      const evaluation::Trajectory& trajectory = robot.estimate.trajectory;
      of_map.push_back(trajectory);
      if (has_one_each)
        together.push_back({{{trajectory}}, evaluation::read_relations(relations_of(reference, robot.robot))});
      if (!run.is_team()) continue;
      const evaluation::TeamRelations own{{{trajectory}}, together.back().relations};
      try {
        rows.push_back(
            {run.name + " " + robot.robot, numbers_of(evaluation::relation_error({own}, options), true), false});
      } catch (const Error& error) {
        log(LogLevel::warning, "robot " + robot.robot + ": " + error.what());
      }
    }
    if (!has_one_each) together.front().maps.push_back(std::move(of_map));
  }
  rows.push_back({run.name + (run.is_team() ? " together" : ""),
                  numbers_of(evaluation::relation_error(together, options), run.is_team())});
  return rows;
}

ExitCode judge_relations(RelationArguments& arguments) {
  evaluation::RelationErrorOptions options;
  options.robot_from_sensor = planar(sensor_pose(arguments.sensor));
  const std::vector<EvaluatedRun> runs = arguments.given.take("relations", {});
  std::vector<NumberRow> rows;
  Json json = Json::array();
  for (const EvaluatedRun& run : runs) {
    std::vector<NumberRow> of_run =
        relation_rows(meant_by(run, arguments.given.reference), arguments.given.reference, options);
    Json numbers = of_run.back().numbers;
    for (std::size_t i = 0; i + 1 < of_run.size(); ++i)
      numbers["robots"][of_run[i].name.substr(run.name.size() + 1)] = of_run[i].numbers;
    json.push_back({{"estimate", run.name}});
    json.back().update(numbers);
    std::move(of_run.begin(), of_run.end(), std::back_inserter(rows));
  }
  if (rows.size() == 1) return report_numbers(rows.front().numbers, arguments.output.json, arguments.output.limits);
  return report_table(rows,
                      {"count", "used", "between_robots", "translation_mean_m", "translation_std_m",
                       "rotation_mean_deg", "rotation_std_deg"},
                      runs.size() == 1 ? json.front() : Json{{"runs", json}}, arguments.output.json,
                      arguments.output.limits);
}

Action set_up_relations(CLI::App& judge) {
  const auto arguments = std::make_shared<RelationArguments>();
  arguments->given.add_to(judge, "--trajectory", "--relations");
  judge
      .add_option("--sensor", arguments->sensor,
                  "pose on the robot of the sensor that the relations speak of: metres and radians")
      ->type_name("X,Y,YAW");
  add_output(judge, arguments->output);
  show_examples(judge, {"mapweave evaluate relations maps/alpha/trajectory.tum intel.relations",
                        "mapweave evaluate relations maps/office alpha.relations --max translation_mean_m=0.5"});
  return [arguments] { return judge_relations(*arguments); };
}

// --- trajectories ---

struct TrajectoryArguments {
  Given given;
  std::string sensor, align = "auto", extrinsics = "keep", delta_unit = "frames", plot;
  TrajectoryJudging judging;
  Output output;
};

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

std::string names_of(const std::vector<EvaluatedRun>& runs) {
  std::string names;
  for (const EvaluatedRun& run : runs) names += (names.empty() ? "" : ", ") + run.name;
  return names;
}

ExitCode judge_trajectories(TrajectoryArguments& arguments) {
  using Kind = evaluation::AlignmentKind;
  using Unit = evaluation::DeltaUnit;
  arguments.judging.relative.unit = arguments.delta_unit == "metres" ? Unit::metres : Unit::frames;
  check(arguments.judging.relative);
  arguments.judging.robot_from_sensor = sensor_pose(arguments.sensor);
  arguments.judging.removes_rotation = arguments.extrinsics == "auto";
  const std::vector<std::pair<std::string, Kind>> kinds = {
      {"none", Kind::none}, {"se2", Kind::se2}, {"se3", Kind::se3}, {"sim3", Kind::sim3}};
  for (const auto& [name, kind] : kinds)
    if (name == arguments.align) arguments.judging.align = kind;
  const std::vector<EvaluatedRun> runs = arguments.given.take("trajectory", arguments.judging.times);
  arguments.judging.reference = arguments.given.reference;
  OutputFile plot{arguments.plot, {arguments.given.reference}, ".png"};
  for (const EvaluatedRun& run : runs)
    for (const auto& robots : run.maps)
      for (const EvaluatedRobot& robot : robots) plot.inputs.push_back(robot.file);
  expect_free(plot);
  std::vector<NumberRow> rows;
  std::vector<exporters::PlottedTrack> tracks;
  Json json = Json::array();
  for (const EvaluatedRun& run : runs) {
    JudgedRun result = judged(run, arguments.judging);
    for (const std::string& note : result.notes) log(LogLevel::warning, run.name + ": " + note);
    const auto name_of = [&](const std::string& robot) { return robot.empty() ? run.name : run.name + " " + robot; };
    json.push_back({{"estimate", run.name}});
    json.back().update(result.numbers);
    for (const auto& [robot, numbers] : result.robots) {
      rows.push_back({name_of(robot), numbers, false});
      json.back()["robots"][robot] = numbers;
    }
    rows.push_back({run.is_team() ? name_of("together") : run.name, result.numbers});
    for (exporters::PlottedTrack& track : result.tracks) {
      track.name = runs.size() > 1 ? name_of(track.name) : track.name;
      tracks.push_back(std::move(track));
    }
  }
  if (!arguments.plot.empty())
    write_output(plot,
                 exporters::trajectory_plot_png(tracks, names_of(runs) + " against " + arguments.given.reference));
  const Output& output = arguments.output;
  if (rows.size() == 1) return report_numbers(rows.front().numbers, output.json, output.limits);
  return report_table(rows,
                      {"pairs", "ate_translation_rmse_m", "ate_rotation_rmse_deg", "rpe_translation_rmse_m",
                       "rpe_rotation_rmse_deg", "drift_translation_percent"},
                      runs.size() == 1 ? json.front() : Json{{"runs", json}}, output.json, output.limits);
}

Action set_up_trajectory(CLI::App& judge) {
  const auto arguments = std::make_shared<TrajectoryArguments>();
  TrajectoryJudging& judging = arguments->judging;
  arguments->given.add_to(judge, "--estimate", "--reference");
  judge
      .add_option("--align", arguments->align,
                  "how estimates are laid on the reference first; auto: se2 where one of them is planar, else se3")
      ->check(one_of({"auto", "none", "se2", "se3", "sim3"}))
      ->capture_default_str();
  judge
      .add_option("--sensor", arguments->sensor,
                  "pose on the robot of the sensor that the reference follows, where the estimate follows the robot: "
                  "X,Y,YAW or X,Y,Z,QX,QY,QZ,QW in metres and radians; optical: a camera that looks ahead")
      ->type_name("POSE");
  judge
      .add_option(
          "--extrinsics", arguments->extrinsics,
          "a constant rotation between the bodies of estimate and reference; keep: a note names it; auto: it is "
          "removed")
      ->transform([](const std::string& name) { return name == "tell" ? std::string("keep") : name; })  // old name
      ->check(one_of({"keep", "auto"}))
      ->capture_default_str();
  judge
      .add_option(
          "--max-difference", judging.error.max_stamp_difference_s,
          "largest difference in seconds between the stamps of an estimated and a reference pose that are compared")
      ->check(number(0.0))
      ->capture_default_str();
  judge.add_option("--delta", judging.relative.delta, "RPE: length of the pieces whose drift is measured")
      ->check(number())
      ->capture_default_str();
  judge.add_option("--delta-unit", arguments->delta_unit, "RPE: unit of --delta")
      ->check(one_of({"frames", "metres"}))
      ->capture_default_str();
  judge.add_flag("--all-pairs", judging.relative.all_pairs,
                 "RPE: measure a piece from every pose; without it each begins where the last one ends");
  judge.add_option("--times", judging.times, "stamps of KITTI's poses, where no times.txt lies beside them")
      ->type_name("TIMES.txt");
  judge.add_option("--plot", arguments->plot, "a picture: trajectories on each other, errors on the way and over time")
      ->type_name("FILE.png");
  add_output(judge, arguments->output);
  show_examples(judge, {"mapweave evaluate trajectory maps/alpha/trajectory.tum groundtruth.txt --plot errors.png",
                        "mapweave evaluate trajectory maps/a/trajectory.tum maps/b/trajectory.tum groundtruth.txt",
                        "mapweave evaluate trajectory maps/office truth/"});
  judge.footer(judge.get_footer() + "\n\nRead are TUM, KITTI's poses, EuRoC's csv, and lines of stamp x y theta.");
  return [arguments] { return judge_trajectories(*arguments); };
}

// --- grids ---

struct GridArguments {
  std::string a, b, align = "none";
  evaluation::GridAgreementOptions agreement;
  Output output;
};

ExitCode judge_grids(const GridArguments& arguments) {
  const OccupancyGrid a = exporters::read_map_server(arguments.a);
  OccupancyGrid b = exporters::read_map_server(arguments.b);
  const GridAlignment alignment = grid_alignment(arguments.align, a, b);
  if (arguments.align != "none") b = evaluation::moved(b, alignment.a_from_b, alignment.scale);
  const auto result = evaluation::grid_agreement(a, b, arguments.agreement);
  Json numbers = {{"resolution_m", result.resolution_m}, {"known_a_m2", result.known_a_m2},
                  {"known_b_m2", result.known_b_m2},     {"common_m2", result.common_m2},
                  {"overlap", result.overlap},           {"agreement", result.agreement},
                  {"conflict", result.conflict},         {"wall_iou", result.wall_iou}};
  if (arguments.align != "none")
    numbers.update({{"a_from_b_x_m", alignment.a_from_b.x},
                    {"a_from_b_y_m", alignment.a_from_b.y},
                    {"a_from_b_yaw_rad", alignment.a_from_b.phi},
                    {"a_from_b_scale", alignment.scale}});
  return report_numbers(numbers, arguments.output.json, arguments.output.limits);
}

Action set_up_grids(CLI::App& judge) {
  const auto arguments = std::make_shared<GridArguments>();
  judge.add_option("A", arguments->a, "map_server file")->required()->type_name("A.yaml");
  judge.add_option("B", arguments->b, "map_server file")->required()->type_name("B.yaml");
  judge
      .add_option("--align", arguments->align,
                  "none: both are in one frame; auto: as merge would lay them on each other; or B's frame in A's")
      ->type_name("none|auto|X,Y,YAW")
      ->capture_default_str();
  judge
      .add_option("--wall-tolerance", arguments->agreement.wall_tolerance_cells,
                  "distance in cells, along x and along y, at which two walls are the same wall; larger values let "
                  "more walls agree")
      ->check(whole_number(0, 20))
      ->capture_default_str();
  add_output(judge, arguments->output);
  show_examples(judge, {"mapweave evaluate grids maps/a/map.yaml maps/b/map.yaml"});
  return [arguments] { return judge_grids(*arguments); };
}

}  // namespace

Action set_up_evaluate(CLI::App& verb) {
  verb.require_subcommand(1);
  std::vector<std::pair<CLI::App*, Action>> judges;
  const auto add = [&](const char* name, const char* summary, Action (*set_up)(CLI::App&)) {
    CLI::App* judge = verb.add_subcommand(name, summary);
    judges.emplace_back(judge, set_up(*judge));
  };
  add("relations", "error of relative poses that people checked by hand (Kuemmerle et al. 2009)", set_up_relations);
  add("trajectory", "absolute and relative error against a reference (ATE, RPE), drift over 100 to 800 m (KITTI)",
      set_up_trajectory);
  add("grids", "agreement and conflict of two grids", set_up_grids);
  add("convert", "a trajectory in another form: TUM, KITTI, EuRoC", set_up_trajectory_conversion);
  return [judges] {
    for (const auto& [judge, act] : judges)
      if (judge->parsed()) return act();
    return ExitCode::wrong_usage;
  };
}

}  // namespace mapweave::app
