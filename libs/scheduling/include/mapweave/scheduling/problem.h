#pragma once
// What is to be planned: robots, what their maps share, edges, links. Read from PROBLEM.json (README).

#include <mapweave/core/ids.h>
#include <mapweave/scheduling/overlap_graph.h>

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace mapweave::scheduling {

struct EdgeResources {
  TierId id;
  double bandwidth_bytes_per_s = 0.0;     // edge -> cloud
  double speed = 1.0;                     // of its processor, relative to the one the latency model was learnt on
  std::optional<std::uint32_t> capacity;  // most robots; none: no bound
  std::optional<double> delay_s = {};     // edge -> cloud; none: the latency model's
};

struct CloudResources {
  double speed = 1.0;  // as of edges
  bool edges_judge =
      true;  // the edges that are used compare what lies on two of them, shared out evenly; else the cloud does
};

struct RobotLink {
  double bytes_per_s = 0.0, delay_s = 0.0;
};

struct Problem {
  std::vector<RobotId> robots;  // vertex i of `overlaps` is robots[i]
  OverlapGraph overlaps;
  std::vector<EdgeResources> edges;
  CloudResources cloud;
  std::vector<std::optional<double>> scans;  // by robot; none: the latency model's default
  std::map<std::pair<std::uint32_t, std::uint32_t>, RobotLink>
      links;  // robot, edge; the default link where a pair is missing
  // By robot: the edge that has its data so far; at another one they are sent and mapped again. None: no edge has any.
  std::vector<std::optional<std::uint32_t>> edge_of = {};
};

// Throws Error kMissing, kCorrupt (not JSON) or kBadInput (JSON that says what cannot be), naming file, key and remedy.
Problem read_problem(const std::filesystem::path&);
// The same from memory; `where` stands for the file in messages.
Problem parse_problem(std::string_view json, const std::string& where);

// How many robots each group takes, largest first, groups of 0 left out: as equal as capacities allow, within one where
// none is reached; never more groups than robots. Throws Error kBadInput where capacities cannot hold everyone.
std::vector<std::uint32_t> group_sizes(const Problem&, const std::string& where = {});

}  // namespace mapweave::scheduling
