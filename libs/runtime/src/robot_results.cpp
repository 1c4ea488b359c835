#include "robot_results.h"

#include <mapweave/core/interrupt.h>

namespace mapweave::runtime {

void add_robot(Results& results, const std::string& folder, const std::string& title, const Map& map,
               const CamerasOutcome& cameras, bool dense) {
  const bool by_laser = cameras.maps.empty() || !map.submaps.empty();
  if (by_laser) results.add_map(folder, title, map);
  if (cameras.maps.empty()) return;
  results.add_cameras(by_laser ? (std::filesystem::path(folder) / "cameras").string() : folder, title,
                      dense && !by_laser, cameras);
  if (dense && by_laser) results.add_dense(folder, title, map, cameras);
}

void acknowledge_interruption(Report& report, bool anything_finished) {
  report.interrupted = true;
  if (!anything_finished) throw Interrupted("interrupted before a map was finished; nothing was written");
  clear_interrupt();
}

}  // namespace mapweave::runtime
