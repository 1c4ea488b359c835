#pragma once
// One robot's cameras from its log to their maps, in one thread and by data time (lockstep).

#include <mapweave/core/progress.h>
#include <mapweave/exporters/contact_sheet.h>
#include <mapweave/exporters/top_view.h>
#include <mapweave/runtime/report.h>
#include <mapweave/runtime/run_configuration.h>
#include <mapweave/runtime/sensor_choice.h>

#include <atomic>
#include <optional>
#include <vector>

namespace mapweave::runtime {

struct CameraResult {
  CameraReport report;
  std::vector<exporters::StampedPose> frames, keyframes;  // poses of the robot
  std::vector<exporters::SheetFrame> sheet;               // a few frames, spread over the time
};

struct CamerasOutcome {
  std::vector<CameraResult> cameras;  // by label
  std::optional<Map> map;             // keyframes and landmarks of all of them; none where nothing was tracked
  std::vector<exporters::ColouredPoint> landmarks;
  double log_seconds = 0.0;
  std::optional<Error> trouble;  // why the stream ended early, or why there is no map
};

// With `keep_going` what came before trouble is mapped. Throws Error(kInterrupted) alone: after a signal, or when `give_up` becomes true.
CamerasOutcome map_cameras(const PlannedRobot&, const ChosenSensors& cameras, const RunConfiguration&, bool keep_going,
                           const std::atomic<bool>& give_up, Progress&);

}  // namespace mapweave::runtime
