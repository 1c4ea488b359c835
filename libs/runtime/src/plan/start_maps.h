#pragma once
// Maps that a run begins with: those of sessions before it (`maps`, --map). They take part as maps of robots that have
// ended already, and the first of them gives the frame.

#include "team/given_maps.h"
#include "team/kept_requests.h"

#include <mapweave/runtime/manifest.h>
#include <mapweave/runtime/run_configuration.h>

namespace mapweave::runtime {

// What a robot that received the team's map (cloud.push_to) finds beside it: a configuration whose `maps` names it.
inline constexpr const char* kNextRun = "next_run.yaml";
std::string next_run_text(const RobotId& robot);

struct StartMaps {
  // Robots' own maps where they are known, by id. No robot and no map is called as one of the run.
  std::vector<Map> maps;
  std::vector<GivenMap> given;  // in the order in which they were given
  std::vector<fusion::MapPrior> priors;
  std::set<std::pair<MapId, MapId>> refused;
  std::set<Hash> vetoed;                   // judgements not to be believed
  std::map<MapId, std::string> cut_short;  // where an interruption ended the log of a map
  std::vector<InputFile> files;
  std::vector<std::string> notes;
  struct Source {
    std::filesystem::path path;
    bool has_scans = false, has_keyframes = false;
  };
  std::vector<Source> sources;  // stores and journals
};

// The plan's. Throws Error: what reading maps throws; kBadInput for a map_server grid, for a map that is given twice,
// and for one without a unit of length (of single cameras).
StartMaps read_start_maps(const RunConfiguration&, const RunPlan&);

// Throws Error(kBadInput) for maps of other sensors than any robot maps with. After choose_sensors().
void expect_same_senses(const StartMaps&, const RunPlan&);

}  // namespace mapweave::runtime
