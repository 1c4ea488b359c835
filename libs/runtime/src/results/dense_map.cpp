#include "dense_map.h"

#include "team_trajectories.h"

#include <mapweave/core/files.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/visual/depth_picture.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <sstream>

namespace mapweave::runtime {
namespace {

constexpr double kSameTime_s = 0.25;  // between two frames farther apart nobody knows how the camera moved

Pose3 pose_or(const std::vector<StampedPose>& frames, const StampedPose& frame, double later_s) {
  const Stamp stamp{frame.stamp.ns + std::llround(1e9 * later_s)};
  return pose_at(frames, stamp, kSameTime_s).value_or(frame.map_from_robot);
}

std::vector<DepthTrajectory> trajectories_of(const CameraMap& part, const CamerasOutcome& cameras,
                                             const std::vector<FrameTrajectory>& trajectories) {
  std::vector<DepthTrajectory> result;
  for (const FrameTrajectory& trajectory : trajectories) {
    const auto camera = std::find_if(cameras.cameras.begin(), cameras.cameras.end(),
                                     [&](const CameraResult& c) { return c.report.label == trajectory.label; });
    if (camera == cameras.cameras.end() || camera->chosen.kind->camera == visual::CameraKind::mono ||
        trajectory.frames.empty())
      continue;
    const SensorCalibration calibration{camera->report.readout_s, camera->report.inverse_depth_offset};
    DepthTrajectory depth{cameras.robot, camera->chosen, calibration, trajectory.frames, {}};
    for (const auto& [id, node] : part.map.nodes)
      if (id.session.client.sensor.str() == sensor_name(trajectory.label)) depth.keyframes.push_back(node.stamp);
    std::sort(depth.keyframes.begin(), depth.keyframes.end());
    result.push_back(std::move(depth));
  }
  return result;
}

// A camera on its second pass.
class Revisit {
 public:
  Revisit(const DepthTrajectory& trajectory, const RunConfiguration& configuration)
      : trajectory_(trajectory),
        dense_(configuration.output.dense),
        packer_({trajectory.chosen.label, trajectory.chosen.kind->camera}) {
    const visual::ClientOptions& client = configuration.visual.client;
    options_ = {client.depth, client.tracking.sigma_px, dense_.most_error_m, trajectory.calibration};
  }

  // What a picture that is wanted shows, in the map, and where its camera stood.
  struct Seen {
    Eigen::Vector3d camera_in_map;
    std::vector<exporters::ColouredPoint> points_in_map;
  };
  std::optional<Seen> operator()(const rawlog::Record& record) {
    if (record.observation->sensorLabel != trajectory_.chosen.label) return std::nullopt;
    const auto placed = std::lower_bound(trajectory_.frames.begin(), trajectory_.frames.end(), record.stamp,
                                         [](const StampedPose& frame, Stamp stamp) { return frame.stamp < stamp; });
    if (placed == trajectory_.frames.end() || placed->stamp != record.stamp) return std::nullopt;
    const bool wanted = dense_.every_frames > 0 ? (placed - trajectory_.frames.begin()) % dense_.every_frames == 0
                                                : std::binary_search(trajectory_.keyframes.begin(),
                                                                     trajectory_.keyframes.end(), record.stamp);
    if (!wanted) return std::nullopt;
    const auto frame = packer_(record);
    if (!frame) return std::nullopt;
    return seen(*frame, *packer_.rig(), *placed);
  }

 private:
  Seen seen(const visual::Frame& frame, const visual::CameraRig& rig, const StampedPose& placed) const {
    const Pose3& robot_from_camera = rig.robot_from_camera;
    const Pose3 map_from_camera = compose(placed.map_from_robot, robot_from_camera);
    const Pose3 map_from_depth = compose(pose_or(trajectory_.frames, placed, frame.depth.delay_s), robot_from_camera);
    const auto depths = visual::depth_picture_of(frame, rig, options_, between(map_from_depth, map_from_camera));
    Seen result{map_from_camera.t, {}};
    for (int y = dense_.step_px / 2; y < depths.height; y += dense_.step_px) {
      // Rows are exposed one after the other, the middle one at the frame's stamp.
      const double later_s = (y - 0.5 * depths.height) / depths.height * trajectory_.calibration.readout_s;
      const Pose3 map_from_row = compose(pose_or(trajectory_.frames, placed, later_s), robot_from_camera);
      for (int x = dense_.step_px / 2; x < depths.width; x += dense_.step_px) {
        const float depth_m = depths.row(y)[x];
        if (depth_m == 0.0F) continue;
        const Eigen::Vector2d pixel(x, y);
        const auto [red, green, blue] = visual::colour_at(frame, rig.camera, pixel);
        result.points_in_map.push_back(
            {transformed(rig.camera.ray(pixel) * static_cast<double>(depth_m), map_from_row).cast<float>(),
             static_cast<std::uint32_t>(red << 16 | green << 8 | blue)});
      }
    }
    return result;
  }

  const DepthTrajectory& trajectory_;
  const DenseOptions& dense_;
  visual::FramePacker packer_;
  visual::DepthPictureOptions options_;
};

// Calls use(Seen) for every picture wanted of one robot's log, in its order.
template <class Use>
void revisit(const PlannedRobot& robot, std::deque<Revisit>& cameras, const rawlog::ReadOptions& reading,
             Progress& progress, Use&& use) {
  const auto log = rawlog::open_log(robot.log, reading);
  ProgressTask task(progress, "depth of " + robot.id.str(), log->bytes_total() / kKilobyte, "kB");
  while (const auto record = log->next()) {
    throw_if_interrupted();
    for (Revisit& camera : cameras)
      if (const auto seen = camera(*record)) use(*seen);
    task.advance(log->bytes_read() / kKilobyte);
  }
}

// Where memory was short.
void note_coarser(const std::string& file, double asked_m, double made_m, double memory_mb,
                  std::vector<std::string>& notes) {
  if (made_m == asked_m) return;
  std::ostringstream note;
  note << file << " is made of cubes of " << made_m << " m: those of " << asked_m << " m needed more than " << memory_mb
       << " MB";
  notes.push_back(note.str());
}

void write_octomap(const std::filesystem::path& folder, exporters::OctoMapWriter& octomap,
                   const exporters::OctoMapOptions& options, std::vector<std::string>& notes) {
  note_coarser("map.bt", options.resolution_m, octomap.resolution_m(), options.memory_mb, notes);
  if (octomap.left_out() > 0)
    notes.push_back("map.bt: " + std::to_string(octomap.left_out()) + " points lie outside of what OctoMap can hold");
  const exporters::OctoMapFiles files = octomap.finish();
  write_file(folder / "map.bt", files.bt);
  write_file(folder / "map.ot", files.ot);
}

}  // namespace

std::vector<DepthTrajectory> depth_trajectories(const CameraMap& part, const CamerasOutcome& cameras) {
  return trajectories_of(part, cameras, part.trajectories);
}

std::vector<DepthTrajectory> depth_trajectories(const Map& map, const Table<MapId, double>& scales,
                                                const CamerasOutcome& cameras) {
  std::vector<DepthTrajectory> result;
  for (const CameraMap& part : cameras.maps) {
    const double* scale = scales.find(part.map.id);
    if (scale != nullptr && *scale != 1.0) continue;
    std::vector<FrameTrajectory> trajectories = part.trajectories;
    for (FrameTrajectory& trajectory : trajectories) trajectory.frames = carried_along(part, trajectory, map, 1.0);
    for (DepthTrajectory& trajectory : trajectories_of(part, cameras, trajectories))
      result.push_back(std::move(trajectory));
  }
  return result;
}

std::vector<std::string> write_dense_map(const std::filesystem::path& folder, const DenseContent& content,
                                         const RunConfiguration& configuration, Progress& progress) {
  const DenseOptions& options = configuration.output.dense;
  const std::vector<DepthTrajectory>& trajectories = content.trajectories;
  MAPWEAVE_EXPECT(content.is_any(), "somebody saw something");
  std::vector<std::string> notes;
  exporters::DepthCloud cloud(options.cloud);
  exporters::OctoMapWriter octomap(options.octomap);
  if (content.octomap)
    for (const exporters::MapSlab& slab : content.slabs) octomap.add(slab);
  std::size_t pictures = 0;
  for (auto first = trajectories.begin(), last = first; first != trajectories.end(); first = last) {
    std::deque<Revisit> cameras;
    for (; last != trajectories.end() && last->robot.log == first->robot.log; ++last)
      cameras.emplace_back(*last, configuration_of(configuration, last->robot));
    try {
      const rawlog::ReadOptions& reading = configuration_of(configuration, first->robot).reading;
      revisit(first->robot, cameras, reading, progress, [&](const Revisit::Seen& seen) {
        if (content.ply) cloud.add(seen.points_in_map);
        if (content.octomap) octomap.add(seen.camera_in_map, seen.points_in_map);
        pictures += seen.points_in_map.empty() ? 0 : 1;
      });
    } catch (const Error& error) {
      notes.push_back("the cloud of depth holds of " + first->robot.id.str() +
                      " what came before this: " + error.what());
    }
  }
  if (pictures == 0 && !trajectories.empty())
    notes.push_back(
        "there is no cloud of depth: no picture showed any that is exact enough (output.dense.most_error_m)");
  if (content.ply && pictures > 0) {
    const auto points = cloud.points();
    write_file(folder / "map.ply", exporters::ply_bytes(points));
    write_file(folder / "map.dense.pcd", exporters::pcd_bytes(points));
    note_coarser("map.ply", options.cloud.voxel_m, cloud.voxel_m(), options.cloud.memory_mb, notes);
  }
  if (content.octomap && (pictures > 0 || !content.slabs.empty()))
    write_octomap(folder, octomap, options.octomap, notes);
  return notes;
}

}  // namespace mapweave::runtime
