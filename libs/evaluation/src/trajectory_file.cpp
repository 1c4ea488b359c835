#include <mapweave/evaluation/trajectory_file.h>

#include "number_lines.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/evaluation/tum_trajectory.h>

#include <Eigen/LU>

#include <algorithm>

namespace mapweave::evaluation {
namespace {

constexpr const char* kForms =
    "TUM (stamp x y z qx qy qz qw), KITTI (12 numbers of a 3 x 4 matrix), EuRoC (csv: nanoseconds,x,y,z,qw,qx,qy,qz) "
    "and stamp x y theta are read";

// Of the first line of numbers.
std::string_view first_line(std::string_view text) {
  while (!text.empty()) {
    const std::size_t end = std::min(text.find('\n'), text.size());
    std::string_view line = text.substr(0, end);
    line = line.substr(0, line.find('#'));
    if (line.find_first_not_of(" \t\r\v\f") != std::string_view::npos) return line;
    text.remove_prefix(std::min(end + 1, text.size()));
  }
  return {};
}

void append(Trajectory& trajectory, const TrajectoryPoint& point, const NumberLines& lines) {
  if (!trajectory.empty() && !(trajectory.back().stamp < point.stamp))
    lines.fail("the stamp is not later than that of the pose before it", "sort the file by stamp, one pose a stamp");
  trajectory.push_back(point);
}

Trajectory parse_planar(std::string_view text, const std::string& where) {
  NumberLines lines(text, where, "stamp x y theta");
  Trajectory trajectory;
  while (lines.next())
    append(trajectory, {lines.stamp(0), spatial(Pose2(lines.number(1), lines.number(2), lines.number(3)))}, lines);
  return trajectory;
}

Trajectory parse_euroc(const std::string& text, const std::string& where, std::size_t columns) {
  std::string format = "nanoseconds x y z qw qx qy qz";
  for (std::size_t further = 8; further < columns; ++further) format += " -";
  NumberLines lines(text, where, format);
  Trajectory trajectory;
  while (lines.next()) {
    const Eigen::Quaterniond q(lines.number(4), lines.number(5), lines.number(6), lines.number(7));
    append(trajectory,
           {lines.nanoseconds(0),
            {{lines.number(1), lines.number(2), lines.number(3)},
             unit_quaternion(q, lines, "the columns are nanoseconds,x,y,z,qw,qx,qy,qz: the real part comes first")}},
           lines);
  }
  return trajectory;
}

Trajectory parse_kitti(std::string_view text, const std::string& where, const std::vector<Stamp>& times) {
  constexpr double kTolerance = 0.01;
  NumberLines lines(text, where, "r11 r12 r13 x r21 r22 r23 y r31 r32 r33 z");
  Trajectory trajectory;
  while (lines.next()) {
    Eigen::Matrix<double, 3, 4> pose;
    for (int i = 0; i < 12; ++i) pose(i / 4, i % 4) = lines.number(static_cast<std::size_t>(i));
    const Eigen::Matrix3d rotation = pose.leftCols<3>();
    if (!((rotation * rotation.transpose()).isIdentity(kTolerance) && rotation.determinant() > 0.0))
      lines.fail("the 3 x 3 part of the matrix is no rotation", "give poses as KITTI writes them, row by row");
    const std::size_t number = trajectory.size();
    if (!times.empty() && number >= times.size())
      lines.fail("there are more poses than the " + std::to_string(times.size()) + " times", "give the poses' times");
    const Stamp stamp = times.empty() ? Stamp{static_cast<std::int64_t>(number) * 1'000'000'000} : times[number];
    append(trajectory, {stamp, {pose.col(3), Eigen::Quaterniond(rotation).normalized()}}, lines);
  }
  if (!times.empty() && trajectory.size() < times.size())
    throw Error(ErrorCode::kBadInput,
                "has " + std::to_string(trajectory.size()) + " poses for " + std::to_string(times.size()) + " times",
                where, "give the times of these poses");
  return trajectory;
}

std::vector<Stamp> parse_times(std::string_view text, const std::string& where) {
  NumberLines lines(text, where, "stamp");
  std::vector<Stamp> times;
  while (lines.next()) times.push_back(lines.stamp(0));
  return times;
}

std::filesystem::path times_beside(const std::filesystem::path& file) {
  const std::filesystem::path folder = file.parent_path(), stem = file.stem();
  for (const std::filesystem::path& times : {folder / (stem.string() + ".times.txt"), folder / "times.txt",
                                             folder / ".." / "sequences" / stem / "times.txt"}) {
    std::error_code ignored;
    if (std::filesystem::is_regular_file(times, ignored)) return times;
  }
  return {};
}

}  // namespace

TrajectoryFile parse_trajectory(std::string_view text, const std::string& where, std::string_view times) {
  const std::string_view line = first_line(text);
  const auto commas = static_cast<std::size_t>(std::count(line.begin(), line.end(), ','));
  TrajectoryFile file;
  if (commas > 0) {
    std::string blanks(text);
    std::replace(blanks.begin(), blanks.end(), ',', ' ');
    if (commas + 1 < 8 && commas + 1 != 4)
      throw Error(ErrorCode::kBadInput, "has lines of " + std::to_string(commas + 1) + " numbers", where, kForms);
    file.format = commas + 1 == 4 ? TrajectoryFormat::planar : TrajectoryFormat::euroc;
    file.trajectory = commas + 1 == 4 ? parse_planar(blanks, where) : parse_euroc(blanks, where, commas + 1);
    return file;
  }
  const std::size_t columns = NumberLines::columns_of(line);
  if (columns == 4) {
    file = {parse_planar(text, where), TrajectoryFormat::planar, true};
  } else if (columns == 12) {
    file = {parse_kitti(text, where, parse_times(times, "times of " + where)), TrajectoryFormat::kitti, !times.empty()};
  } else if (columns == 8 || columns == 0) {
    file = {parse_tum(text, where), TrajectoryFormat::tum, true};
  } else {
    throw Error(ErrorCode::kBadInput, "has lines of " + std::to_string(columns) + " numbers", where, kForms);
  }
  return file;
}

TrajectoryFile read_trajectory(const std::filesystem::path& file, const std::filesystem::path& times_file) {
  const std::string text = read_file(file);
  const std::filesystem::path times = times_file.empty() ? times_beside(file) : times_file;
  const bool needs_times = NumberLines::columns_of(first_line(text)) == 12 && !times.empty();
  return parse_trajectory(text, file.string(), needs_times ? read_file(times) : std::string());
}

}  // namespace mapweave::evaluation
