#pragma once
// The page of a program that runs: its maps so far, who speaks with whom, and what is wrong. Its looks and drawing are
// those of report.html.

#include <mapweave/maps/map.h>
#include <mapweave/maps/occupancy_grid.h>

#include <nlohmann/json_fwd.hpp>

#include <string>
#include <vector>

namespace mapweave::report {

// A map so far as the page draws it. map: its nodes and constraints. grid: of it; without known cells: trajectories
// alone are drawn. robots: as live_page() has them; sessions of others are left out.
nlohmann::ordered_json live_map(const std::string& title, const Map& map, const OccupancyGrid& grid,
                                const std::vector<std::string>& robots);

// status: what runtime::program_status() says now. The page asks the server that it is of, and nothing else, for
// - `events`: server-sent events; `status`: {status, maps: number of the newest maps}; `end`: the program ends,
// - `maps.json`: {number, maps: [live_map()]}, when the number is another.
// Texts of the status are never executed.
std::string live_page(const std::string& title, const std::vector<std::string>& robots,
                      const nlohmann::ordered_json& status);

}  // namespace mapweave::report
