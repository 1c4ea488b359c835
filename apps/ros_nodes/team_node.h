#pragma once
// A whole team in one node: records its robots' topics, maps and merges them, and writes the folder of results.

#include <command.h>

#include <string>
#include <vector>

namespace mapweave::ros_nodes {

struct TeamArguments {
  std::filesystem::path file;       // a configuration; empty: robots alone are named
  std::vector<std::string> robots;  // their namespaces
  app::WritingFlags flags;
  int port = 0;  // of its page; negative: none
};
// team/finish (std_srvs/Trigger), or Ctrl-C, ends all drives.
ExitCode serve_team(const TeamArguments& arguments);

}  // namespace mapweave::ros_nodes
