#include <mapweave/report/live_page.h>

#include "grid_levels.h"
#include "map_links.h"
#include "page_text.h"
#include "trajectory_data.h"
#include "view_bounds.h"

#include <algorithm>

namespace mapweave::report {

Json live_map(const std::string& title, const Map& map, const OccupancyGrid& grid,
              const std::vector<std::string>& robots) {
  constexpr std::size_t kMostPoses = 1000, kMostLinks = 300;
  constexpr GridDetail kDetail{1200, 1200};
  Json json = {{"title", title}, {"conflicts", Json::array()}, {"trajectories", Json::array()}};
  json.update(links_json(map, kMostLinks));
  ViewBounds bounds;
  if (has_known_cells(grid)) {
    const DrawnGrid drawn = drawn_grid(grid, kDetail);
    json["grid"] = drawn.json;
    bounds.add(drawn);
  }
  for (auto node = map.nodes.begin(); node != map.nodes.end();) {
    const SessionId session = node->first.session;
    evaluation::Trajectory trajectory;
    for (; node != map.nodes.end() && node->first.session == session; ++node)
      if (trajectory.empty() || trajectory.back().stamp < node->second.stamp)
        trajectory.push_back({node->second.stamp, node->second.map_from_node});
    const auto robot = std::find(robots.begin(), robots.end(), session.client.robot.str());
    if (robot == robots.end()) continue;
    for (const evaluation::TrajectoryPoint& point : trajectory) bounds.add(point.pose.t.x(), point.pose.t.y());
    Json one = trajectory_json(trajectory, kMostPoses);
    one["robot"] = robot - robots.begin();
    json["trajectories"].push_back(std::move(one));
  }
  json["view"] = bounds.json();
  return json;
}

std::string live_page(const std::string& title, const std::vector<std::string>& robots, const Json& status) {
  Json names = Json::array();
  for (const std::string& robot : robots) names.push_back({{"name", robot}});
  return page_text(PageKind::live, title,
                   {{"robots", names}, {"status", status}, {"maps", Json::array()}, {"number", 0}});
}

}  // namespace mapweave::report
