#include "trajectory_conversion.h"

#include "command_line.h"
#include "output_file.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/evaluation/trajectory_file.h>
#include <mapweave/exporters/trajectory_files.h>

#include <memory>
#include <sstream>

namespace mapweave::app {
namespace {

struct Arguments {
  std::filesystem::path from, to, times, at;
  std::string format = "auto";
};

std::string format_of(const Arguments& arguments) {
  if (arguments.format != "auto") return arguments.format;
  const std::string ending = arguments.to.extension().string();
  if (ending == ".tum") return "tum";
  if (ending == ".csv") return "euroc";
  throw Error(ErrorCode::kUsage, "the name does not say which form is wanted", arguments.to.string(),
              "add --to tum, kitti or euroc, or call it FILE.tum or FILE.csv");
}

// One pose for each stamp of a file of times, as KITTI wants one for each picture.
std::vector<StampedPose> at_times(const std::vector<StampedPose>& poses, const std::filesystem::path& times) {
  constexpr double kLongestGap_s = 1.0, kSameTime_s = 1e-5;
  std::istringstream text(read_file(times));
  std::vector<StampedPose> result;
  for (double seconds = 0.0; text >> seconds;) {
    const Stamp stamp = stamp_from_seconds(seconds);
    auto pose = pose_at(poses, stamp, kLongestGap_s);
    for (const StampedPose* end : {&poses.front(), &poses.back()})  // stamps are written to the microsecond
      if (!pose && std::abs(seconds_between(end->stamp, stamp)) < kSameTime_s) pose = end->map_from_robot;
    if (!pose)
      throw Error(ErrorCode::kBadInput,
                  "there is no pose at " + std::to_string(seconds) + " s, line " + std::to_string(result.size() + 1) +
                      " of " + times.string(),
                  {}, "give the times of frames that were tracked");
    result.push_back({stamp, *pose});
  }
  if (!text.eof() || result.empty())
    throw Error(ErrorCode::kBadInput, "holds no times, or something else beside them", times.string(),
                "give one stamp in seconds a line");
  return result;
}

ExitCode convert(const Arguments& arguments) {
  const std::string format = format_of(arguments);
  const std::vector<std::filesystem::path> inputs = {arguments.from, arguments.times, arguments.at};
  const evaluation::TrajectoryFile read = evaluation::read_trajectory(arguments.from, arguments.times);
  if (!read.has_stamps)
    throw Error(ErrorCode::kMissing, "poses of KITTI have no stamps", arguments.from.string(),
                "put their times.txt beside them, or name it: --times FILE");
  std::vector<StampedPose> poses;
  for (const auto& point : read.trajectory) poses.push_back({point.stamp, point.pose});
  if (!arguments.at.empty()) poses = at_times(poses, arguments.at);
  if (format == "kitti") {
    const OutputFile times{arguments.to.parent_path() / (arguments.to.stem().string() + ".times.txt"), inputs, ""};
    expect_free(times);
    write_output({arguments.to, inputs, ""}, exporters::kitti_text(poses));
    write_output(times, exporters::kitti_times_text(poses));
  } else {
    write_output({arguments.to, inputs, ""},
                 format == "euroc" ? exporters::euroc_text(poses) : exporters::tum_text(poses));
  }
  return ExitCode::done;
}

}  // namespace

Action set_up_trajectory_conversion(CLI::App& verb) {
  const auto arguments = std::make_shared<Arguments>();
  verb.add_option("FROM", arguments->from, "TUM, KITTI's poses, EuRoC's csv, or stamp x y theta")->required();
  verb.add_option("TO", arguments->to, "the file to write; of KITTI also NAME.times.txt beside it")->required();
  verb.add_option("--to", arguments->format, "the form; auto: by the name (.tum, .csv: EuRoC)")
      ->check(one_of({"auto", "tum", "kitti", "euroc"}))
      ->capture_default_str();
  verb.add_option("--times", arguments->times, "stamps of KITTI's poses, where no times.txt lies beside them")
      ->type_name("TIMES.txt");
  verb.add_option("--at", arguments->at,
                  "a stamp in seconds a line: poses at these, as KITTI wants one for each picture")
      ->type_name("TIMES.txt");
  show_examples(verb, {"mapweave evaluate convert maps/06/trajectory.tum 06.txt --to kitti --at 06/times.txt"});
  return [arguments] { return convert(*arguments); };
}

}  // namespace mapweave::app
