#pragma once
// The folder that run, slam and merge leave: maps with their pictures, and the papers beside them.

#include "dense_map.h"
#include "team/kept_requests.h"

#include <mapweave/core/files.h>
#include <mapweave/core/progress.h>
#include <mapweave/core/stopwatch.h>
#include <mapweave/core/worker_pool.h>
#include <mapweave/fusion/fuse.h>
#include <mapweave/mapdb/map_store.h>
#include <mapweave/runtime/camera_task.h>
#include <mapweave/runtime/manifest.h>
#include <mapweave/runtime/report.h>
#include <mapweave/runtime/run_configuration.h>
#include <mapweave/runtime/team_frame.h>

#include <functional>
#include <map>
#include <optional>
#include <string>

namespace mapweave::runtime {

// Whose a map is: which dense files are written of it depends on that.
enum class MapOf { single, robot, edge, team, pushed };

// Where what a tier fused is written: the largest component into `folder`, others into `further` + "1", "2", ...
// Numbered: where there are several, all of them go into `further` + "1", "2", ..., and none into `folder`.
struct FusedPlace {
  TierId tier;
  std::string folder, further, title;
  std::vector<TeamFrame> frames;  // of each component
  MapOf of = MapOf::team;
  bool robot_trajectories = false, is_numbered = false;
};
inline FusedPlace team_place(std::vector<TeamFrame> frames) {
  return {cloud_tier(), "team", "team-", "team", std::move(frames), MapOf::team, true, true};
}

// In the metadata of a store: where an interruption ended the log of its map; of a team, that of a member.
inline constexpr const char* kCutShortKey = "cut_short";
inline std::string cut_short_key(const MapId& member) { return kCutShortKey + ("." + member.str()); }

// Dense files that are not written yet.
struct DenseRequest {
  std::filesystem::path folder;  // which is there
  std::string title;             // for people
  DenseContent content;
};

class Results {
 public:
  // Its wall time begins here. Nothing is seen of it before commit(). Throws Error(kCannotWrite) at once where it could
  // not be written.
  Results(const std::filesystem::path& out, bool force, const RunConfiguration& configuration, WorkerPool& pool,
          Progress& progress);

  // A robot's own map, into `folder` ("robots/alpha"; "" for the top): map.mwdb, pictures, trajectory, and what is
  // asked for of dense files. A map that cannot be drawn has no pictures, and a note says why; after an interruption no
  // more are drawn. `cameras`: whose keyframes it holds beside the laser's scans; what they saw of depth takes a second
  // pass over the log.
  void add_map(const std::string& folder, const std::string& title, MapOf of, const Map& map,
               const CamerasOutcome& cameras = {});
  // The same of a robot that maps with cameras: landmarks from above, their cloud, frames' and keyframes' trajectories,
  // a contact sheet; of further cameras in `folder`/cameras/LABEL, of maps that stayed apart in `folder`/apart-1, -2,
  // ... `of`: whose maps they are; nothing where what their depth shows belongs to another map.
  void add_cameras(const std::string& folder, const std::string& title, std::optional<MapOf> of,
                   const CamerasOutcome& cameras);
  // A robot's pose as it came, beside its map (output.tum).
  void add_pose(const std::string& folder, const rig::FusedTrajectory& pose);
  // What was fused; its stages, and composing as the fifth, into the report. `cameras`: what the fused maps of
  // keyframes came from, for the frames between them.
  void add_components(const FusedPlace& place, const fusion::FusionResult& fused,
                      const std::vector<CamerasOutcome>& cameras, Report& report);
  // rounds.json, and pictures of joint maps that came out of rounds.
  void add_rounds(const Report& report);
  // A file of its own, beside what else is in its folder.
  void add_file(const std::filesystem::path& file, const std::string& text);
  // Of a joined map at the top: the robot's trajectory is the one to look at, as of a map of it alone.
  void put_trajectory_first(const RobotId& robot);
  // Robots' own maps, as they were fused; stores of components keep those of their members, so that a merge can be
  // undone. They must outlive it.
  void set_own_maps(std::vector<const Map*> maps) { own_maps_ = std::move(maps); }
  // Where an interruption ended the log, in words: stores say it.
  void set_cut_short(std::string where) { cut_short_ = std::move(where); }
  // The same of maps that were given: their stores, and those of their teams, go on saying it.
  void set_cut_short(std::map<MapId, std::string> where) { cut_short_maps_ = std::move(where); }
  // Who writes dense files: all at commit(), with the notes of each; nullopt: this process does. Throws Interrupted.
  using DenseMaker =
      std::function<std::vector<std::optional<std::vector<std::string>>>(const std::vector<DenseRequest>&)>;
  void set_dense_maker(DenseMaker maker) { dense_maker_ = std::move(maker); }
  // What was said beside the maps: stores of components keep it.
  void set_requests(KeptRequests requests) { requests_ = std::move(requests); }
  // Adds notes, times and memory to the report, then config.yaml, summary.json, merges.json (not for slam) and
  // manifest.json; then the folder appears. What was interrupted replaces no older results: it appears beside them.
  void commit(const std::string& verb, const RunConfiguration& effective, const std::vector<InputFile>& inputs,
              Report& report);

  static FusionReport report_of(TierId tier, const fusion::FusionResult& fused, std::vector<TeamFrame> frames);

 private:
  OccupancyGrid grid_of(const std::string& title, const Map& map);
  void add_camera_map(const std::filesystem::path& folder, const std::string& title, const CameraMap& map,
                      const PlannedRobot& robot);
  DenseContent dense_content(MapOf of) const;
  void draw_dense(const std::filesystem::path& folder, const std::string& title, DenseContent content);
  void draw_requested();
  std::vector<exporters::MapSlab> slabs(const std::string& title, const Map& map, const OccupancyGrid& composed);
  // Returns by what identity it stands there: a new one, or the next version of what it continues.
  MapIdentity store(const std::string& folder, mapdb::StoredMaps stored, const MapIdentity& continued);
  MapIdentity store(const std::string& folder, const Map& map);
  void draw_landmarks(const std::filesystem::path& folder, const std::string& title, const Map& map,
                      const std::vector<exporters::SessionTrajectory>& trajectories);
  void write_page();
  void draw_seen(const std::string& folder, const std::string& title, bool robot_trajectories,
                 const fusion::Component& component, const std::vector<CamerasOutcome>& cameras);
  // `conflicts`: drawn in a picture of their own, where there are any. Returns the grid that was drawn.
  OccupancyGrid draw(const std::string& folder, const std::string& title, bool robot_trajectories, const Map& map,
                     const MapIdentity& identity, const std::vector<exporters::PictureMark>& conflicts = {});
  const RunConfiguration& configuration_;
  WorkerPool& pool_;
  Progress& progress_;
  Stopwatch watch_;
  OutputFolder folder_;
  double composing_seconds_ = 0.0, output_seconds_ = 0.0;
  bool interrupted_ = false, saw_depth_ = false, saw_slabs_ = false;
  DenseMaker dense_maker_;
  std::vector<DenseRequest> requested_;
  std::vector<std::size_t> notes_before_;  // each of these
  std::vector<std::string> notes_;
  std::vector<const Map*> own_maps_;
  KeptRequests requests_;
  std::string cut_short_;
  std::map<MapId, std::string> cut_short_maps_;
  std::map<std::string, MapIdentity> identities_;  // by the paths of stores
};

}  // namespace mapweave::runtime
