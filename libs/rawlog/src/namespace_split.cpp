#include "folder_split.h"
#include "ros/bag_formats.h"
#include "ros/topic_choice.h"
#include "task.h"

#include <mapweave/core/error.h>
#include <mapweave/rawlog/rawlog_writer.h>
#include <mapweave/rawlog/split.h>

#include <algorithm>
#include <cctype>
#include <system_error>

namespace mapweave::rawlog {
namespace {

// Names of ROS; anything else could lead out of the folder.
bool is_name(const std::string& name) {
  return std::all_of(name.begin(), name.end(),
                     [](unsigned char c) { return std::isalnum(c) != 0 || c == '_' || c == '-'; });
}

SplitPart write_robot(const std::filesystem::path& bag, const std::string& robot, std::filesystem::path path,
                      const ReadOptions& options, Progress& progress) {
  ReadOptions of_robot = options;
  of_robot.robot_namespace = robot;
  const auto stream = open_log(bag, of_robot);
  RawlogWriter writer(path);
  SplitPart part;
  part.path = std::move(path);
  Task task(progress, "reading " + robot + " of " + bag.filename().string(), *stream);
  while (const auto record = stream->next()) {
    if (part.observations == 0) part.first = record->stamp;
    part.last = record->stamp;
    count_observation(*record->observation, part);
    writer.add(*record->observation);
    task.step();
  }
  writer.close();
  return part;
}

}  // namespace

std::vector<SplitPart> split_by_namespace(const std::filesystem::path& bag, const std::filesystem::path& out_folder,
                                          const ReadOptions& options, Progress& progress) {
  const auto reader = ros::open_bag(bag, options);
  if (!reader)
    throw Error(ErrorCode::kBadInput, "is no ROS bag; only bags have namespaces", bag.string(),
                "cut it by time with --robots N");
  const auto robots = ros::robot_namespaces(reader->topics());
  if (robots.empty())
    throw Error(ErrorCode::kBadInput, "its sensors are in no namespace", bag.string(),
                "look at its topics with: mapweave inspect BAG");
  make_part_folder(out_folder);
  std::vector<SplitPart> parts;
  try {
    for (const std::string& robot : robots) {
      if (!is_name(robot))
        throw Error(ErrorCode::kBadInput, "'" + robot + "' is no name of a namespace", bag.string(),
                    "name the topics of one robot with reading.topics");
      parts.push_back(write_robot(bag, robot, out_folder / (robot + ".rawlog"), options, progress));
    }
  } catch (...) {
    std::error_code ignored;
    for (const SplitPart& part : parts) std::filesystem::remove(part.path, ignored);
    throw;
  }
  return parts;
}

}  // namespace mapweave::rawlog
