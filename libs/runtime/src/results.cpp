#include "results.h"
#include "team_trajectories.h"

#include <mapweave/core/interrupt.h>
#include <mapweave/exporters/g2o_file.h>
#include <mapweave/exporters/map_folder.h>
#include <mapweave/exporters/top_view.h>
#include <mapweave/exporters/trajectory_files.h>
#include <mapweave/mapdb/map_store.h>
#include <mapweave/runtime/metrics.h>

#include <nlohmann/json.hpp>

#include <algorithm>

namespace mapweave::runtime {
namespace {

// What a component's map rests on.
mapdb::StoredMaps stored(const fusion::Component& component, const fusion::FusionResult& fused,
                         const std::vector<const Map*>& own_maps, const KeptRequests& requests) {
  mapdb::StoredMaps result;
  result.maps = {component.map};
  for (const Map* own : own_maps)
    if (std::binary_search(component.members.begin(), component.members.end(), own->id))
      result.members.push_back({component.map.id, *own});
  for (const Judgement& judgement : fused.judgements)
    if (holds(component.map, judgement.a) && holds(component.map, judgement.b)) result.judgements.push_back(judgement);
  const auto is_member = [&](const MapId& id) {
    return std::binary_search(component.members.begin(), component.members.end(), id);
  };
  for (const Verdict& verdict : fused.verdicts)
    if (is_member(verdict.a) || is_member(verdict.b)) result.verdicts.push_back(verdict);
  result.metadata["program"] = "mapweave " + program_version();
  if (!result.members.empty()) keep(requests, component.members, result.metadata);
  return result;
}

}  // namespace

Results::Results(const std::filesystem::path& out, bool force, const RunConfiguration& configuration, WorkerPool& pool,
                 Progress& progress)
    : configuration_(configuration), pool_(pool), progress_(progress), folder_(out, force) {}

OccupancyGrid Results::grid_of(const std::string& title, const Map& map) {
  if (interrupted_) return {};
  const Stopwatch watch;
  try {
    OccupancyGrid grid = fusion::compose_grid(map, configuration_.compose, pool_);
    composing_seconds_ += watch.seconds();
    return grid;
  } catch (const Interrupted&) {
    interrupted_ = true;
    clear_interrupt();  // what is finished is saved; a further signal ends that too
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kBadInput) throw;
    notes_.push_back(title + " is not drawn: " + error.what());
  }
  return {};
}

void Results::draw(const std::string& folder, const std::string& title, bool robot_trajectories, const Map& map,
                   const std::vector<exporters::PictureMark>& conflicts) {
  exporters::MapFolderOptions options = folder_options(configuration_.output, title);
  options.files.robot_trajectories = robot_trajectories && configuration_.output.tum;
  const std::size_t notes = notes_.size();
  const bool is_drawn = configuration_.output.png || configuration_.output.pgm;
  const OccupancyGrid grid = is_drawn ? grid_of(title, map) : OccupancyGrid();
  if (is_drawn && grid.log_odds.empty() && !interrupted_ && notes_.size() == notes)
    notes_.push_back(title + " is not drawn: nothing was seen");
  exporters::write_map_folder(folder_.staging() / folder, map, grid, options);
  if (!map.landmarks.empty() && !grid.empty()) draw_landmarks_on(grid, folder, title, map);
  if (conflicts.empty() || !configuration_.output.png || grid.empty()) return;
  options.picture.title = title + ": walls of a map that was taken apart, seen through by another";
  write_file(folder_.staging() / folder / "conflicts.png",
             exporters::map_picture_png(grid, {}, options.picture, conflicts));
}

void Results::add_map(const std::string& folder, const std::string& title, const Map& map) {
  const Stopwatch watch;
  draw(folder, title, false, map);
  store(folder, map);
  output_seconds_ += watch.seconds();
}

void Results::store(const std::string& folder, const Map& map) {
  mapdb::StoredMaps stored;
  stored.maps = {map};
  stored.metadata["program"] = "mapweave " + program_version();
  mapdb::write_store(folder_.staging() / folder / "map.mwdb", stored);
}

void Results::add_camera_map(const std::filesystem::path& folder, const std::string& title, const CameraMap& part) {
  const OutputOptions& output = configuration_.output;
  const std::filesystem::path top = folder_.staging() / folder;
  std::filesystem::create_directories(top);
  const auto write_keyframes = [&](const std::filesystem::path& place, const FrameTrajectory& trajectory) {
    for (const exporters::SessionTrajectory& keyframes : exporters::session_trajectories(part.map))
      if (keyframes.session.client.sensor.str() == sensor_name(trajectory.label))
        write_file(place / "keyframes.tum", exporters::tum_text(keyframes.poses));
  };
  if (output.tum) {
    write_file(top / "trajectory.tum", exporters::tum_text(part.trajectory));
    write_keyframes(top, part.trajectories.front());
  }
  for (const FrameTrajectory& trajectory : part.trajectories) {
    if (!output.tum || part.trajectories.size() == 1) continue;
    const std::filesystem::path place = top / "cameras" / sensor_name(trajectory.label);
    std::filesystem::create_directories(place);
    write_file(place / "trajectory.tum", exporters::tum_text(trajectory.frames));
    write_keyframes(place, trajectory);
  }
  draw_landmarks(folder, title, part.map, {{{{part.map.robots().front(), SensorId()}, 0}, part.trajectory}});
  store(folder.string(), part.map);
}

void Results::draw_landmarks(const std::filesystem::path& folder, const std::string& title, const Map& map,
                             const std::vector<exporters::SessionTrajectory>& trajectories) {
  const OutputOptions& output = configuration_.output;
  const std::filesystem::path top = folder_.staging() / folder;
  const auto landmarks = exporters::landmark_cloud(map);
  if (output.pcd) write_file(top / "map.pcd", exporters::pcd_bytes(landmarks));
  if (output.g2o) write_file(top / "map.g2o", exporters::g2o_text(map));
  if (!output.png) return;
  exporters::PictureOptions picture = output.picture;
  if (picture.title.empty()) picture.title = title;
  write_file(top / "map.png", exporters::top_view_png(landmarks, trajectories, picture));
}

void Results::draw_landmarks_on(const OccupancyGrid& grid, const std::filesystem::path& folder,
                                const std::string& title, const Map& map) {
  if (!configuration_.output.png) return;
  exporters::PictureOptions picture = configuration_.output.picture;
  if (picture.title.empty()) picture.title = title;
  write_file(
      folder_.staging() / folder / "map.color.png",
      exporters::top_view_png(exporters::landmark_cloud(map), exporters::session_trajectories(map), picture, &grid));
}

void Results::draw_dense(const std::filesystem::path& folder, const std::string& title,
                         const std::vector<DepthTrajectory>& trajectories) {
  if (interrupted_ || trajectories.empty() || !(configuration_.output.ply || configuration_.output.octomap)) return;
  saw_depth_ = true;
  try {
    for (const std::string& note : write_dense_map(folder_.staging() / folder, trajectories, configuration_, progress_))
      notes_.push_back(title + ": " + note);
  } catch (const Interrupted&) {
    interrupted_ = true;
    clear_interrupt();  // as for grids
  }
}

void Results::add_dense(const std::string& folder, const std::string& title, const Map& map,
                        const CamerasOutcome& cameras) {
  const Stopwatch watch;
  draw_dense(folder, title, depth_trajectories(map, {}, cameras));
  output_seconds_ += watch.seconds();
}

void Results::draw_seen(const std::string& folder, const std::string& title, bool robot_trajectories,
                        const fusion::Component& component, const std::vector<CamerasOutcome>& cameras) {
  const std::filesystem::path top = folder_.staging() / folder;
  std::filesystem::create_directories(top);
  const auto trajectories = team_trajectories(component, cameras, configuration_.rig.trajectory);
  if (configuration_.output.tum) {
    write_file(top / "trajectory.tum", exporters::tum_text(trajectories));
    if (robot_trajectories) std::filesystem::create_directories(top / "trajectories");
    for (std::size_t i = 0; robot_trajectories && i < trajectories.size(); ++i)
      if (i == 0 || trajectories[i - 1].session.client.robot != trajectories[i].session.client.robot)
        write_file(top / "trajectories" / (trajectories[i].session.client.robot.str() + ".tum"),
                   exporters::tum_text(trajectories[i].poses));
  }
  draw_landmarks(folder, title, component.map, trajectories);
}

void Results::add_cameras(const std::string& folder, const std::string& title, bool dense,
                          const CamerasOutcome& cameras) {
  const Stopwatch watch;
  for (std::size_t i = 0; i < cameras.maps.size(); ++i) {
    const std::string apart = std::to_string(i), name = i == 0 ? title : title + ", apart " + apart;
    const std::filesystem::path place =
        i == 0 ? std::filesystem::path(folder) : std::filesystem::path(folder) / ("apart-" + apart);
    add_camera_map(place, name, cameras.maps[i]);
    if (dense) draw_dense(place, name, depth_trajectories(cameras.maps[i], cameras));
  }
  for (const std::string& note : cameras.notes) notes_.push_back(title + ": " + note);
  if (cameras.maps.size() > 1 && cameras.notes.empty())
    notes_.push_back(title + ": its cameras left " + std::to_string(cameras.maps.size()) +
                     " maps that stayed apart: one was lost, went on elsewhere and came to no place that it knew");
  const std::string& first = cameras.maps.front().trajectories.front().label;
  for (const CameraResult& camera : cameras.cameras) {
    for (const std::string& note : camera.notes)
      notes_.push_back(title + ", camera " + camera.report.label + ": " + note);
    if (!configuration_.output.png || camera.sheet.empty()) continue;
    exporters::ContactSheetOptions sheet;
    sheet.title = title + ", camera " + camera.report.label;
    const std::filesystem::path top = folder_.staging() / folder;
    const std::filesystem::path place =
        camera.report.label == first ? top : top / "cameras" / sensor_name(camera.report.label);
    std::filesystem::create_directories(place);
    write_file(place / "frames.png", exporters::contact_sheet_png(camera.sheet, sheet));
  }
  output_seconds_ += watch.seconds();
}

namespace {

// Where the component's maps would show walls twice with those that were taken apart from it. Other walls that were
// seen through moved.
std::vector<exporters::PictureMark> conflicts_in(const fusion::Component& component,
                                                 const std::vector<fusion::PairAudit>& audits) {
  std::vector<exporters::PictureMark> marks;
  for (const fusion::PairAudit& audit : audits) {
    const Pose3* frame = component.team_from_map.find(audit.a);
    if (!audit.is_ghost || frame == nullptr) continue;
    for (const auto& conflict : audit.conflicts) {
      const Pose2 place = compose(planar(*frame), Pose2{conflict.x_m, conflict.y_m, 0.0});
      marks.push_back({place.x, place.y, 0.5 * conflict.length_m});
    }
  }
  return marks;
}

}  // namespace

void Results::add_components(const FusedPlace& place, const fusion::FusionResult& fused,
                             const std::vector<CamerasOutcome>& cameras, Report& report) {
  const Stopwatch watch;
  const double composing_before = composing_seconds_;
  for (std::size_t i = 0; i < fused.components.size(); ++i) {
    const std::string folder = i == 0 ? place.folder : place.further + std::to_string(i);
    const std::string name = i == 0 ? place.title : place.title + ", apart " + std::to_string(i);
    const Map& map = fused.components[i].map;
    const auto conflicts = conflicts_in(fused.components[i], fused.audits);
    if (map.submaps.empty() && has_keyframes(map))
      draw_seen(folder, name, place.robot_trajectories, fused.components[i], cameras);
    else
      draw(folder, name, place.robot_trajectories, map, conflicts);
    std::vector<DepthTrajectory> depth;
    for (const CamerasOutcome& outcome : cameras)
      for (DepthTrajectory& trajectory : depth_trajectories(map, fused.components[i].scales, outcome))
        depth.push_back(std::move(trajectory));
    if (place.tier == cloud_tier()) draw_dense(folder, name, depth);
    mapdb::write_store(folder_.staging() / folder / "map.mwdb",
                       stored(fused.components[i], fused, own_maps_, requests_));
  }
  const double composing = composing_seconds_ - composing_before;
  output_seconds_ += watch.seconds() - composing;
  for (const fusion::StageTime& stage : fused.stages) report.stages.push_back({place.tier, stage.name, stage.seconds});
  report.stages.push_back({place.tier, "composing", composing});
}

void Results::commit(const std::string& verb, const RunConfiguration& effective, const std::vector<InputFile>& inputs,
                     Report& report) {
  report.notes.insert(report.notes.end(), notes_.begin(), notes_.end());
  if ((configuration_.output.ply || configuration_.output.octomap) && !saw_depth_ && !interrupted_)
    report.notes.push_back(
        "there is no cloud of depth: nothing was mapped with a depth camera or a stereo pair whose log is here");
  report.interrupted = report.interrupted || interrupted_;
  report.stages.push_back({TierId(), "output", output_seconds_});
  report.wall_seconds = watch_.seconds();
  report.peak_rss_bytes = peak_rss_bytes();
  for (const char* picture : {"team/map.color.png", "map.color.png", "map.png"})
    if (report.picture.empty() && std::filesystem::exists(folder_.staging() / picture)) report.picture = picture;
  const std::filesystem::path& staging = folder_.staging();
  write_file(staging / "config.yaml", to_yaml(effective));
  write_file(staging / "summary.json", summary_json(report).dump(2) + "\n");
  if (verb != "slam") write_file(staging / "merges.json", merges_json(report).dump(2) + "\n");
  std::vector<InputFile> all_inputs = inputs;
  if (const std::string& vocabulary = effective.visual.vocabulary; !vocabulary.empty())
    all_inputs.push_back({vocabulary, hash_of_file(vocabulary)});
  write_file(staging / "manifest.json", manifest_json(verb, effective.seed, all_inputs, staging).dump(2) + "\n");
  folder_.commit();
}

FusionReport Results::report_of(TierId tier, const fusion::FusionResult& fused) {
  FusionReport report;
  report.tier = tier;
  for (const fusion::Component& component : fused.components) report.components.push_back(component.members);
  report.verdicts = fused.verdicts;
  report.audits = fused.audits;
  return report;
}

}  // namespace mapweave::runtime
