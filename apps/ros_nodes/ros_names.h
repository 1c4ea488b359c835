#pragma once
// Names of robots and tiers in topics and frames.

#include <map>
#include <string>
#include <vector>

namespace mapweave::ros_nodes {

// A name for each id, as ROS allows it (exporters::ros_name()), no two the same. All programs of a deployment that have
// the same ids in the same order have the same names. Logs each id whose name differs from it.
class RosNames {
 public:
  explicit RosNames(const std::vector<std::string>& ids);
  std::string of(const std::string& id) const;  // of an id that was not given: exporters::ros_name()

 private:
  std::map<std::string, std::string> names_;
};

}  // namespace mapweave::ros_nodes
