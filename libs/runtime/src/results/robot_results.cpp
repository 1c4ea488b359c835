#include "robot_results.h"

#include <mapweave/core/interrupt.h>

namespace mapweave::runtime {

void add_robot(Results& results, const std::string& folder, const std::string& title, MapOf of, const Map& map,
               const CamerasOutcome& cameras) {
  const bool by_laser = cameras.maps.empty() || !map.submaps.empty();
  if (by_laser) results.add_map(folder, title, of, map, cameras);
  if (cameras.maps.empty()) return;
  if (by_laser)
    results.add_cameras((std::filesystem::path(folder) / "cameras").string(), title, std::nullopt, cameras);
  else
    results.add_cameras(folder, title, of, cameras);
}

void acknowledge_interruption(Report& report, bool anything_finished) {
  report.interrupted = true;
  if (!anything_finished) throw Interrupted("interrupted before a map was finished; nothing was written");
  clear_interrupt();
}

}  // namespace mapweave::runtime
