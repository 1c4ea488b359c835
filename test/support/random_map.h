#pragma once
// Maps of random numbers, for tests of what carries maps: every kind of payload, submap and constraint occurs; nothing
// in them makes sense.

#include <mapweave/maps/map_update.h>

#include <algorithm>
#include <limits>
#include <random>

namespace mapweave::test {

class RandomMaps {
 public:
  explicit RandomMaps(std::uint64_t seed) : engine_(seed) {}

  double uniform(double low, double high) {
    return low + (high - low) * (static_cast<double>(engine_() >> 11) * 0x1p-53);
  }
  std::uint64_t below(std::uint64_t count) { return engine_() % count; }

  Pose3 pose(bool is_planar = false) {
    if (is_planar) return spatial(Pose2(uniform(-90, 90), uniform(-90, 90), uniform(-3, 3)));
    Pose3 pose;
    pose.t = {uniform(-90, 90), uniform(-90, 90), uniform(-3, 3)};
    pose.q = Eigen::Quaterniond(uniform(-1, 1), uniform(-1, 1), uniform(-1, 1), uniform(0.1, 1)).normalized();
    return pose;
  }

  std::shared_ptr<const ScanGeometry> geometry(std::uint32_t ray_count) {
    ScanGeometry geometry;
    geometry.first_angle_rad = -M_PI / 2;
    geometry.angle_step_rad = M_PI / ray_count;
    geometry.ray_count = ray_count;
    geometry.max_range_m = 80.0;
    geometry.robot_from_laser = pose(true);
    return std::make_shared<const ScanGeometry>(geometry);
  }

  std::shared_ptr<const Payload> scan(const std::shared_ptr<const ScanGeometry>& geometry) {
    PackedScan scan{geometry, {}};
    std::uint64_t range = 2000;
    for (std::uint32_t ray = 0; ray < geometry->ray_count; ++ray)
      scan.ranges.push_back(static_cast<std::uint16_t>(range += below(40)));
    return std::make_shared<const Payload>(std::move(scan));
  }

  std::shared_ptr<const Payload> grid(std::int32_t columns, std::int32_t rows) {
    OccupancyGrid grid;
    grid.origin_x_m = uniform(-9, 9);
    grid.columns = columns;
    grid.rows = rows;
    for (std::int32_t cell = 0; cell < columns * rows; ++cell)
      grid.log_odds.push_back(static_cast<std::int16_t>(below(65536)));
    return std::make_shared<const Payload>(std::move(grid));
  }

  Eigen::Matrix<double, 6, 6> symmetric() {
    Eigen::Matrix<double, 6, 6> matrix;
    for (int row = 0; row < 6; ++row)
      for (int column = row; column < 6; ++column)
        matrix(row, column) = matrix(column, row) = row == column ? uniform(1, 1e4) : uniform(-1, 1);
    return matrix;
  }

  Eigen::Matrix3d planar_symmetric() { return symmetric().topLeftCorner<3, 3>(); }

  // One session of `node_count` nodes (each third without content, the fifth a grid) with a submap of every ten.
  Map map(const std::string& name, std::uint32_t node_count, std::uint32_t ray_count = 20) {
    Map map;
    map.id = MapId(name);
    const SessionId session{{RobotId(name), SensorId("laser")},
                            static_cast<std::int64_t>(1'000'000'000'000'000'000 + below(1'000'000'000))};
    const auto first = geometry(ray_count), second = geometry(ray_count);
    for (std::uint32_t i = 0; i < node_count; ++i) {
      Node node{{session, i}, {session.run + std::int64_t{i} * 200'000'000}, pose(i % 2 == 0), nullptr};
      if (i == 5)
        node.payload = grid(7, 3);
      else if (i % 3 != 1)
        node.payload = scan(i % 4 == 0 ? second : first);
      map.nodes.set(node.id, node);
      if (i == 0) continue;
      const ConstraintId id{
          i % 2 == 0 ? ConstraintKind::odometry : ConstraintKind::scan_match, {session, i - 1}, {session, i}, 0};
      map.constraints.set(id, planar_constraint(id, Pose2(uniform(0, 1), 0, uniform(-0.1, 0.1)), planar_symmetric()));
    }
    for (std::uint32_t begin = 0; begin + 3 <= node_count; begin += 10) {
      Submap submap;
      submap.id = {session, begin / 10};
      submap.frozen = begin + 10 < node_count;
      for (std::uint32_t i = begin; i < std::min(begin + 10, node_count); ++i) {
        if (map.nodes.find({session, i})->payload == nullptr) continue;
        submap.submap_from_node.emplace_back(NodeId{session, i},
                                             submap.submap_from_node.empty() ? Pose3{} : pose(true));
      }
      if (submap.frozen) submap.content = content_hash(submap, map.nodes);
      map.submaps.set(submap.id, submap);
    }
    if (node_count > 2) {
      Constraint loop;
      loop.id = {ConstraintKind::loop, {session, node_count - 1}, {session, 0}, 3};
      loop.from_from_to = {pose(), 1.25};
      loop.information = symmetric();
      loop.because = hash();
      map.constraints.set(loop.id, loop);
      loop.id.index = 4;
      loop.information(2, 3) += 1e-9;  // as rounding leaves it
      map.constraints.set(loop.id, loop);
    }
    return map;
  }

  std::shared_ptr<const CameraGeometry> camera() {
    CameraGeometry camera;
    camera.width = 640;
    camera.height = 480;
    camera.fx = camera.fy = uniform(400, 600);
    camera.cx = uniform(300, 340);
    camera.cy = uniform(220, 260);
    camera.baseline_m = 0.075;
    camera.robot_from_camera = pose();
    return std::make_shared<const CameraGeometry>(camera);
  }

  std::shared_ptr<const Payload> keyframe(const std::shared_ptr<const CameraGeometry>& camera,
                                          std::uint32_t feature_count) {
    KeyframeFeatures keyframe{camera, {}, {}};
    for (std::uint32_t i = 0; i < feature_count; ++i) {
      const LandmarkSighting place = sighting({});
      keyframe.points.push_back(
          {place.u, place.v, place.inverse_depth, place.level, static_cast<std::uint8_t>(below(256))});
      keyframe.descriptors.push_back({engine_(), engine_(), engine_(), engine_()});
    }
    return std::make_shared<const Payload>(std::move(keyframe));
  }

  LandmarkSighting sighting(const NodeId& node) {
    LandmarkSighting sighting;
    sighting.node = node;
    sighting.u = static_cast<std::uint16_t>(below(16 * 640));
    sighting.v = static_cast<std::uint16_t>(below(16 * 480));
    sighting.inverse_depth = static_cast<std::uint16_t>(below(3) == 0 ? 0 : below(65536));
    sighting.level = static_cast<std::uint8_t>(below(8));
    return sighting;
  }

  // One session of keyframes, each fourth a pose only, with a submap of every ten and three landmarks a keyframe, seen
  // by it and some of the next ones.
  Map keyframe_map(const std::string& name, std::uint32_t node_count, std::uint32_t feature_count = 9) {
    Map map;
    map.id = MapId(name);
    const SessionId session{{RobotId(name), SensorId("camera")},
                            static_cast<std::int64_t>(1'000'000'000'000'000'000 + below(1'000'000'000))};
    const auto first = camera(), second = camera();
    std::vector<NodeId> keyframes;
    for (std::uint32_t i = 0; i < node_count; ++i) {
      const NodeId id{session, i};
      const bool is_bare = i % 4 == 3;
      map.nodes.set(id, {id,
                         {session.run + std::int64_t{i} * 33'000'000},
                         pose(),
                         is_bare ? nullptr : keyframe(i < 8 ? first : second, feature_count)});
      if (!is_bare) keyframes.push_back(id);
      if (i == 0) continue;
      Constraint constraint;
      constraint.id = {ConstraintKind::odometry, {session, i - 1}, id, 0};
      constraint.from_from_to.pose = pose();
      constraint.information = symmetric();
      map.constraints.set(constraint.id, constraint);
    }
    for (std::size_t k = 0; k < keyframes.size(); ++k)
      for (int i = 0; i < 3; ++i) {
        Landmark landmark;
        landmark.id = {session, static_cast<std::uint32_t>(map.landmarks.size())};
        landmark.anchor = keyframes[k];
        landmark.point_units = landmark_units({uniform(-20, 20), uniform(-20, 20), uniform(-3, 3)});
        for (std::uint8_t& part : landmark.colour) part = static_cast<std::uint8_t>(below(256));
        for (std::size_t at = k; at < std::min(k + 5, keyframes.size()); ++at)
          if (at == k || below(3) > 0) landmark.seen.push_back(sighting(keyframes[at]));
        map.landmarks.set(landmark.id, landmark);
      }
    for (std::size_t begin = 0; begin < keyframes.size(); begin += 10) {
      Submap submap;
      submap.id = {session, static_cast<std::uint32_t>(begin / 10)};
      for (std::size_t k = begin; k < std::min(begin + 10, keyframes.size()); ++k)
        submap.submap_from_node.emplace_back(keyframes[k], k == begin ? Pose3{} : pose());
      submap.frozen = begin + 10 < keyframes.size();
      if (submap.frozen) submap.content = content_hash(submap, map.nodes);
      map.submaps.set(submap.id, submap);
    }
    return map;
  }

  Hash hash() { return hash_of_bytes(std::to_string(engine_())); }

  Alignment alignment() { return {{pose(), uniform(0.5, 2)}, symmetric()}; }

  Judgement judgement(const SubmapId& a, const SubmapId& b) {
    Judgement judgement;
    judgement.id = hash();
    judgement.a = std::min(a, b);
    judgement.b = std::max(a, b);
    judgement.content_a = hash();
    judgement.content_b = hash();
    for (std::uint64_t i = below(4); i > 0; --i) {
      judgement.hypotheses.push_back(alignment());
      judgement.scores.push_back(uniform(0, 1));
    }
    judgement.evidence.overlap_m2 = uniform(0, 100);
    judgement.evidence.longest_contradiction_m[1] = uniform(0, 3);
    judgement.evidence.observability = {uniform(0, 1), uniform(0, 1), uniform(0, 1)};
    judgement.probability = uniform(0, 1);
    judgement.doubt = static_cast<Reason>(below(8));
    return judgement;
  }

  Verdict verdict(const MapId& a, const MapId& b) {
    Verdict verdict;
    verdict.a = std::min(a, b);
    verdict.b = std::max(a, b);
    verdict.by = TierId("cloud");
    verdict.proposer = "descriptor";
    verdict.decision = static_cast<Decision>(below(3));
    verdict.reason = static_cast<Reason>(below(8));
    if (below(2) == 0) verdict.alignment = alignment();
    verdict.probability = uniform(0, 1);
    verdict.overlap = uniform(0, 1);
    verdict.witnesses = {hash(), hash()};
    verdict.contradicted = {hash()};
    return verdict;
  }

 private:
  std::mt19937_64 engine_;
};

}  // namespace mapweave::test
