#pragma once
// The folder that run, slam and merge leave: maps with their pictures, and the papers beside them.

#include "dense_map.h"
#include "kept_requests.h"

#include <mapweave/core/files.h>
#include <mapweave/core/progress.h>
#include <mapweave/core/stopwatch.h>
#include <mapweave/core/worker_pool.h>
#include <mapweave/fusion/fuse.h>
#include <mapweave/runtime/camera_task.h>
#include <mapweave/runtime/manifest.h>
#include <mapweave/runtime/report.h>
#include <mapweave/runtime/run_configuration.h>

namespace mapweave::runtime {

// Where what a tier fused is written: the largest component into `folder`, others into `further` + "1", "2", ...
struct FusedPlace {
  TierId tier;
  std::string folder, further, title;
  bool robot_trajectories = false;
};
inline FusedPlace team_place() { return {cloud_tier(), "team", "team-", "team", true}; }

class Results {
 public:
  // Its wall time begins here. Nothing is seen of it before commit(). Throws Error(kCannotWrite) at once where it could
  // not be written.
  Results(const std::filesystem::path& out, bool force, const RunConfiguration& configuration, WorkerPool& pool,
          Progress& progress);

  // A robot's own map, into `folder` ("robots/alpha"; "" for the top): map.mwdb, pictures, trajectory. A map that
  // cannot be drawn has no pictures, and a note says why; after an interruption no more are drawn.
  void add_map(const std::string& folder, const std::string& title, const Map& map);
  // The same of a robot that maps with cameras: landmarks from above, their cloud, frames' and keyframes' trajectories,
  // a contact sheet; of further cameras in `folder`/cameras/LABEL, of maps that stayed apart in `folder`/apart-1, -2,
  // ... `dense`: also what is asked for of depth, which takes a second way through the log.
  void add_cameras(const std::string& folder, const std::string& title, bool dense, const CamerasOutcome& cameras);
  // What the cameras' depth shows, in a map that holds their keyframes beside the laser's scans.
  void add_dense(const std::string& folder, const std::string& title, const Map& map, const CamerasOutcome& cameras);
  // What was fused; its stages, and composing as the fifth, into the report. `cameras`: what the fused maps of
  // keyframes came from, for the frames between them. Depth is the cloud's alone.
  void add_components(const FusedPlace& place, const fusion::FusionResult& fused,
                      const std::vector<CamerasOutcome>& cameras, Report& report);
  // Robots' own maps, as they were fused; stores of components keep those of their members, so that a merge can be
  // undone. They must outlive it.
  void set_own_maps(std::vector<const Map*> maps) { own_maps_ = std::move(maps); }
  // What was said beside the maps: stores of components keep it.
  void set_requests(KeptRequests requests) { requests_ = std::move(requests); }
  // Adds notes, times and memory to the report, then config.yaml, summary.json, merges.json (not for slam) and
  // manifest.json; then the folder appears.
  void commit(const std::string& verb, const RunConfiguration& effective, const std::vector<InputFile>& inputs,
              Report& report);

  static FusionReport report_of(TierId tier, const fusion::FusionResult& fused);

 private:
  OccupancyGrid grid_of(const std::string& title, const Map& map);
  void add_camera_map(const std::filesystem::path& folder, const std::string& title, const CameraMap& map);
  void draw_dense(const std::filesystem::path& folder, const std::string& title,
                  const std::vector<DepthTrajectory>& trajectories);
  void store(const std::string& folder, const Map& map);
  void draw_landmarks(const std::filesystem::path& folder, const std::string& title, const Map& map,
                      const std::vector<exporters::SessionTrajectory>& trajectories);
  // Of a map of both kinds: instead of the grid alone.
  void draw_landmarks_on(const OccupancyGrid& grid, const std::filesystem::path& folder, const std::string& title,
                         const Map& map);
  void draw_seen(const std::string& folder, const std::string& title, bool robot_trajectories,
                 const fusion::Component& component, const std::vector<CamerasOutcome>& cameras);
  // `conflicts`: drawn in a picture of their own, where there are any.
  void draw(const std::string& folder, const std::string& title, bool robot_trajectories, const Map& map,
            const std::vector<exporters::PictureMark>& conflicts = {});
  const RunConfiguration& configuration_;
  WorkerPool& pool_;
  Progress& progress_;
  Stopwatch watch_;
  OutputFolder folder_;
  double composing_seconds_ = 0.0, output_seconds_ = 0.0;
  bool interrupted_ = false, saw_depth_ = false;
  std::vector<std::string> notes_;
  std::vector<const Map*> own_maps_;
  KeptRequests requests_;
};

}  // namespace mapweave::runtime
