#include "ros_names.h"

#include <mapweave/core/log.h>
#include <mapweave/exporters/ros_recording.h>

#include <set>

namespace mapweave::ros_nodes {

RosNames::RosNames(const std::vector<std::string>& ids) {
  std::set<std::string> taken;
  // Ids that are names already keep them.
  for (const std::string& id : ids)
    if (exporters::ros_name(id) == id && names_.emplace(id, id).second) taken.insert(id);
  for (const std::string& id : ids) {
    if (names_.count(id) != 0) continue;
    const std::string name = exporters::unique_ros_name(id, taken);
    names_.emplace(id, name);
    log(LogLevel::info,
        "'" + id + "' is called '" + name + "' in topics and frames: ROS allows letters, digits and '_'");
  }
}

std::string RosNames::of(const std::string& id) const {
  const auto found = names_.find(id);
  return found != names_.end() ? found->second : exporters::ros_name(id);
}

}  // namespace mapweave::ros_nodes
