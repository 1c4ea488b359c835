#include "results.h"
#include "team/given_maps.h"
#include "team_trajectories.h"
#include "trajectory_output.h"

#include <mapweave/core/format.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/core/log.h>
#include <mapweave/exporters/g2o_file.h>
#include <mapweave/exporters/map_folder.h>
#include <mapweave/exporters/top_view.h>
#include <mapweave/exporters/trajectory_files.h>
#include <mapweave/mapdb/map_store.h>
#include <mapweave/runtime/json_text.h>
#include <mapweave/runtime/map_slabs.h>
#include <mapweave/runtime/metrics.h>
#include <mapweave/runtime/results_page.h>

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
  if (!result.members.empty()) keep(requests, component.members, result.metadata);
  return result;
}

// Results that are a part themselves.
bool is_interrupted(const std::filesystem::path& folder) {
  std::error_code ignored;
  const std::filesystem::path manifest = folder / "manifest.json";
  if (!std::filesystem::is_regular_file(manifest, ignored)) return false;
  const auto json = nlohmann::json::parse(read_file(manifest), nullptr, false);
  return json.is_object() && json.value("interrupted", nlohmann::json()) == true;
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

OccupancyGrid Results::draw(const std::string& folder, const std::string& title, bool robot_trajectories,
                            const Map& map, const MapIdentity& identity,
                            const std::vector<exporters::PictureMark>& conflicts) {
  exporters::MapFolderOptions options = folder_options(configuration_.output, title);
  options.identity = identity;
  options.files.robot_trajectories = robot_trajectories;
  const std::size_t notes = notes_.size();
  const bool is_drawn = configuration_.output.png || configuration_.output.pgm;
  OccupancyGrid grid = is_drawn ? grid_of(title, map) : OccupancyGrid();
  if (is_drawn && grid.log_odds.empty() && map.landmarks.empty() && !interrupted_ && notes_.size() == notes)
    notes_.push_back(title + " is not drawn: nothing was seen");
  exporters::write_map_folder(folder_.staging() / folder, map, grid, options);
  if (conflicts.empty() || !configuration_.output.png || grid.empty()) return grid;
  options.picture.title = title + ": walls of a map that was taken apart, seen through by another";
  write_file(folder_.staging() / folder / "conflicts.png",
             exporters::map_picture_png(grid, {}, options.picture, conflicts));
  return grid;
}

void Results::add_map(const std::string& folder, const std::string& title, MapOf of, const Map& map,
                      const CamerasOutcome& cameras) {
  const Stopwatch watch;
  const OccupancyGrid grid = draw(folder, title, false, map, store(folder, map));
  DenseContent content = dense_content(of);
  if (content.octomap) content.slabs = slabs(title, map, grid);
  if (content.ply || content.octomap) content.trajectories = depth_trajectories(map, {}, cameras);
  draw_dense(folder, title, std::move(content));
  output_seconds_ += watch.seconds();
}

MapIdentity Results::store(const std::string& folder, mapdb::StoredMaps stored, const MapIdentity& continued) {
  const std::filesystem::path path = std::filesystem::path(folder) / "map.mwdb";
  stored.metadata["program"] = "mapweave " + program_version();
  const MapIdentity identity = next_version(continued, mapdb::identity(stored));
  keep(identity, stored.metadata);
  if (!cut_short_.empty()) stored.metadata[kCutShortKey] = cut_short_;
  for (const auto& [id, where] : cut_short_maps_) {
    const auto is_it = [&id = id](const mapdb::MemberMap& member) { return member.own.id == id; };
    if (std::any_of(stored.members.begin(), stored.members.end(), is_it)) stored.metadata[cut_short_key(id)] = where;
    if (stored.members.empty() && stored.maps.front().id == id) stored.metadata[kCutShortKey] = where;
  }
  std::filesystem::create_directories((folder_.staging() / path).parent_path());
  mapdb::write_store(folder_.staging() / path, stored);
  identities_[path.generic_string()] = identity;
  return identity;
}

MapIdentity Results::store(const std::string& folder, const Map& map) {
  mapdb::StoredMaps stored;
  stored.maps = {map};
  return store(folder, std::move(stored), {});
}

void Results::add_camera_map(const std::filesystem::path& folder, const std::string& title, const CameraMap& part,
                             const PlannedRobot& robot) {
  const OutputOptions& output = configuration_.output;
  const std::filesystem::path top = folder_.staging() / folder;
  std::filesystem::create_directories(top);
  if (output.tum) write_camera_trajectories(top, part, robot);
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

void Results::add_pose(const std::string& folder, const rig::FusedTrajectory& pose) {
  if (configuration_.output.tum) write_robot_pose(folder_.staging() / folder, pose);
}

// Without content: which files are written of such a map.
DenseContent Results::dense_content(MapOf of) const {
  const OutputOptions& output = configuration_.output;
  const bool is_last = of == MapOf::single || of == MapOf::team;
  const bool is_wanted = is_last || (of == MapOf::edge && output.octomaps_of != OctoMapsOf::team) ||
                         (of == MapOf::robot && output.octomaps_of == OctoMapsOf::all);
  DenseContent content;
  content.ply = output.ply && is_last;
  content.octomap = output.octomap && is_wanted;
  return content;
}

std::vector<exporters::MapSlab> Results::slabs(const std::string& title, const Map& map,
                                               const OccupancyGrid& composed) {
  if (interrupted_) return {};
  try {
    return slabs_of(map, composed, configuration_, pool_);
  } catch (const Interrupted&) {
    interrupted_ = true;
    clear_interrupt();  // as for grids
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kBadInput) throw;
    notes_.push_back(title + " has no OctoMap: " + error.what());
  }
  return {};
}

void Results::draw_dense(const std::filesystem::path& folder, const std::string& title, DenseContent content) {
  if (interrupted_ || !content.is_any()) return;
  saw_depth_ = saw_depth_ || !content.trajectories.empty();
  saw_slabs_ = saw_slabs_ || !content.slabs.empty();
  requested_.push_back({folder_.staging() / folder, title, std::move(content)});
  notes_before_.push_back(notes_.size());
  if (!dense_maker_) draw_requested();
}

// Notes of each stand where they would if it had been drawn when it was asked for.
void Results::draw_requested() {
  std::vector<std::optional<std::vector<std::string>>> drawn(requested_.size());
  try {
    if (dense_maker_) drawn = dense_maker_(requested_);
    for (std::size_t i = 0; i < requested_.size(); ++i)
      if (!drawn[i]) drawn[i] = write_dense_map(requested_[i].folder, requested_[i].content, configuration_, progress_);
  } catch (const Interrupted&) {
    interrupted_ = true;
    clear_interrupt();  // as for grids
  }
  for (std::size_t i = requested_.size(); i-- > 0;) {
    if (!drawn[i]) continue;
    for (std::string& note : *drawn[i]) note = requested_[i].title + ": " + note;
    notes_.insert(notes_.begin() + static_cast<std::ptrdiff_t>(notes_before_[i]), drawn[i]->begin(), drawn[i]->end());
  }
  requested_.clear();
  notes_before_.clear();
}

void Results::draw_seen(const std::string& folder, const std::string& title, bool robot_trajectories,
                        const fusion::Component& component, const std::vector<CamerasOutcome>& cameras) {
  const std::filesystem::path top = folder_.staging() / folder;
  std::filesystem::create_directories(top);
  const auto trajectories = team_trajectories(component, cameras, configuration_);
  if (configuration_.output.tum) write_team_trajectories(top, trajectories, cameras, robot_trajectories);
  draw_landmarks(folder, title, component.map, trajectories);
}

void Results::add_cameras(const std::string& folder, const std::string& title, std::optional<MapOf> of,
                          const CamerasOutcome& cameras) {
  const Stopwatch watch;
  for (std::size_t i = 0; i < cameras.maps.size(); ++i) {
    const std::string apart = std::to_string(i), name = i == 0 ? title : title + ", apart " + apart;
    const std::filesystem::path place =
        i == 0 ? std::filesystem::path(folder) : std::filesystem::path(folder) / ("apart-" + apart);
    add_camera_map(place, name, cameras.maps[i], cameras.robot);
    if (!of) continue;
    DenseContent content = dense_content(*of);
    if (content.ply || content.octomap) content.trajectories = depth_trajectories(cameras.maps[i], cameras);
    draw_dense(place, name, std::move(content));
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

namespace {

std::string note_on_bent(const MapId& id, const std::string& component) {
  return "walls of the map '" + id.str() +
         "' stood double, and matches of its own visits to one place mended it: in '" + component +
         "' it is bent against the loops that it had closed; robots/" + id.str() + " keeps it as it was";
}

}  // namespace

void Results::add_components(const FusedPlace& place, const fusion::FusionResult& fused,
                             const std::vector<CamerasOutcome>& cameras, Report& report) {
  const Stopwatch watch;
  const double composing_before = composing_seconds_;
  for (std::size_t i = 0; i < fused.components.size(); ++i) {
    const bool is_numbered = place.is_numbered && fused.components.size() > 1;
    const std::string number = std::to_string(is_numbered ? i + 1 : i);
    const std::string folder = i == 0 && !is_numbered ? place.folder : place.further + number;
    const std::string apart = is_numbered ? " " + number : i == 0 ? "" : ", apart " + number;
    const std::string name = place.title + apart;
    const Map& map = fused.components[i].map;
    const auto conflicts = conflicts_in(fused.components[i], fused.audits);
    if (place.of == MapOf::team)
      for (const MapId& id : fused.components[i].bent) report.notes.push_back(note_on_bent(id, name));
    mapdb::StoredMaps whole = stored(fused.components[i], fused, own_maps_, requests_);
    keep(place.frames[i], whole.metadata);
    const MapIdentity identity = store(folder, std::move(whole), place.frames[i].continued);
    OccupancyGrid grid;
    if (map.submaps.empty() && has_keyframes(map))
      draw_seen(folder, name, place.robot_trajectories, fused.components[i], cameras);
    else
      grid = draw(folder, name, place.robot_trajectories, map, identity, conflicts);
    DenseContent content = dense_content(place.of);
    if (!content.ply && !content.octomap) continue;
    if (content.octomap) content.slabs = slabs(name, map, grid);
    for (const CamerasOutcome& outcome : cameras)
      for (DepthTrajectory& trajectory : depth_trajectories(map, fused.components[i].scales, outcome))
        content.trajectories.push_back(std::move(trajectory));
    draw_dense(folder, name, std::move(content));
  }
  const double composing = composing_seconds_ - composing_before;
  output_seconds_ += watch.seconds() - composing;
  for (const fusion::StageTime& stage : fused.stages) report.stages.push_back({place.tier, stage.name, stage.seconds});
  report.stages.push_back({place.tier, "composing", composing});
}

void Results::add_rounds(const Report& report) {
  const Stopwatch watch;
  const double composing_before = composing_seconds_;
  const std::filesystem::path& staging = folder_.staging();
  std::map<std::size_t, std::string> pictures;
  for (const auto& [round, map] : report.rounds->pictures) {
    if (!configuration_.output.png) break;
    const std::string title = format("round %zu, after %.1f s", round + 1, report.work.rounds[round].at_s);
    const OccupancyGrid grid = grid_of(title, map);
    if (grid.empty()) continue;
    exporters::PictureOptions picture = configuration_.output.picture;
    picture.title = title;
    std::filesystem::create_directories(staging / "rounds");
    pictures[round] = format("rounds/%04zu.png", round + 1);
    write_file(staging / pictures[round],
               exporters::map_picture_png(grid, exporters::session_trajectories(map), picture));
  }
  write_file(
      staging / "rounds.json",
      rounds_json_text(report.work.rounds,
                       report.timeline && report.timeline->rounds ? &*report.timeline->rounds : nullptr, pictures));
  output_seconds_ += watch.seconds() - (composing_seconds_ - composing_before);
}

void Results::add_file(const std::filesystem::path& file, const std::string& text) {
  std::filesystem::create_directories((folder_.staging() / file).parent_path());
  write_file(folder_.staging() / file, text);
}

void Results::put_trajectory_first(const RobotId& robot) {
  const std::filesystem::path& top = folder_.staging();
  for (const auto& [of, as] : {std::pair(std::filesystem::path("trajectories"), "trajectory.tum"),
                               std::pair(std::filesystem::path("trajectories/robot"), "trajectory.robot.tum"),
                               std::pair(std::filesystem::path("trajectories/optical"), "trajectory.optical.tum")})
    if (const auto file = top / of / (robot.str() + ".tum"); std::filesystem::exists(file))
      write_file(top / as, read_file(file));
}

void Results::commit(const std::string& verb, const RunConfiguration& effective, const std::vector<InputFile>& inputs,
                     Report& report) {
  if (!requested_.empty()) {
    const Stopwatch watch;
    draw_requested();
    output_seconds_ += watch.seconds();
  }
  report.notes.insert(report.notes.end(), notes_.begin(), notes_.end());
  const bool lacks_octomap = configuration_.output.octomap && !saw_slabs_;
  if ((configuration_.output.ply || lacks_octomap) && !saw_depth_ && !interrupted_)
    report.notes.push_back(
        "there is no cloud of depth: nothing was mapped with a depth camera or a stereo pair whose log is here");
  report.interrupted = report.interrupted || interrupted_;
  if (report.interrupted && !is_interrupted(folder_.goal()) && folder_.step_aside(".interrupted")) {
    report.saved_at = folder_.goal().string();
    report.notes.push_back("the older results stay as they were: what was interrupted is beside them, in " +
                           folder_.goal().filename().string());
  }
  report.stages.push_back({TierId(), "output", output_seconds_});
  report.wall_seconds = watch_.seconds();
  report.peak_rss_bytes = peak_rss_bytes();
  for (const char* picture :
       {"team/map.color.png", "team/map.png", "team-1/map.color.png", "team-1/map.png", "map.color.png", "map.png"})
    if (report.picture.empty() && std::filesystem::exists(folder_.staging() / picture)) report.picture = picture;
  const std::filesystem::path& staging = folder_.staging();
  write_file(staging / "config.yaml", to_yaml(effective));
  write_file(staging / "summary.json", json_text(summary_json(report)) + "\n");
  if (verb != "slam" || !report.team.verdicts.empty())
    write_file(staging / "merges.json", json_text(merges_json(report)) + "\n");
  std::vector<InputFile> all_inputs = inputs;
  if (const std::string& vocabulary = effective.visual.vocabulary; !vocabulary.empty())
    all_inputs.push_back({vocabulary, hash_of_file(vocabulary)});
  auto manifest = manifest_json(verb, effective.seed, all_inputs, staging, identities_);
  if (report.interrupted) manifest["interrupted"] = true;
  write_file(staging / "manifest.json", json_text(manifest) + "\n");
  if (configuration_.output.report) write_page();
  folder_.commit();
}

// It shows the other files: where it cannot be made, they are worth no less.
void Results::write_page() {
  std::string page;
  try {
    page = results_page(folder_.staging(), {});
  } catch (const std::exception& error) {
    log(LogLevel::warning, std::string("report.html is not written: ") + error.what());
    return;
  }
  write_file(folder_.staging() / "report.html", page);
}

FusionReport Results::report_of(TierId tier, const fusion::FusionResult& fused, std::vector<TeamFrame> frames) {
  FusionReport report;
  report.tier = tier;
  report.frames = std::move(frames);
  for (const fusion::Component& component : fused.components) {
    report.components.push_back(component.members);
    report.team_from_maps.push_back(component.team_from_map);
  }
  report.verdicts = fused.verdicts;
  report.audits = fused.audits;
  return report;
}

}  // namespace mapweave::runtime
