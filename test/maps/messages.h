#pragma once
// One of each message: what tests send, damage and compare, and the seeds of fuzz targets.

#include <mapweave/maps/coordination.h>
#include <mapweave/maps/exchange.h>
#include <mapweave/maps/merged_maps.h>
#include <mapweave/maps/pair_to_judge.h>
#include <mapweave/maps/receipt.h>
#include <support/random_map.h>

#include <random>

namespace mapweave::test {

const SessionId kAlphaCamera{{RobotId("alpha"), SensorId("camera")}, 1600000000000000000},
    kBetaCamera{{RobotId("beta"), SensorId("camera")}, 5};
const SessionId kAlphaLaser{{RobotId("alpha"), SensorId("laser")}, 1600000000000000000},
    kBetaLaser{{RobotId("beta"), SensorId("laser")}, -5};

inline DescribedLandmark landmark(std::mt19937_64& random, std::uint32_t index) {
  const auto draw = [&](double most) { return most * (2.0 * static_cast<double>(random() >> 11) * 0x1.0p-53 - 1.0); };
  DescribedLandmark result;
  result.id = {index % 2 == 0 ? kAlphaCamera : kBetaCamera, index};
  result.point_in_map = {draw(50.0), draw(50.0), draw(3.0)};
  result.descriptor = {random(), random(), random(), random()};
  result.feature_from_point = {draw(0.02), draw(0.02), draw(0.02)};
  result.direction = Eigen::Vector3d(draw(1.0), draw(1.0), draw(1.0)).normalized();
  result.nearest_m = 0.5 + std::abs(draw(2.0));
  result.farthest_m = result.nearest_m + std::abs(draw(5.0));
  result.sigma_m = 0.01 + std::abs(draw(0.1));
  return result;
}

inline Share share() {
  std::mt19937_64 random(3);
  Share result;
  result.map = MapId("beta.camera");
  for (std::uint32_t i = 0; i < 200; ++i) result.landmarks.push_back(landmark(random, i));
  for (const auto& axis : {Eigen::Vector3d::UnitX(), Eigen::Vector3d::UnitY(), Eigen::Vector3d::UnitZ()})
    for (const double sign : {1.0, -1.0}) {
      result.landmarks.push_back(landmark(random, 300));
      result.landmarks.back().direction = sign * axis;
    }
  result.landmarks.push_back(landmark(random, 301));
  result.landmarks.back().direction.setZero();
  result.landmarks.back().farthest_m = result.landmarks.back().nearest_m = 0.0;
  result.corrected.push_back({{kBetaCamera, 4}, {{1.0, 2.0, 0.5}, Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5)}});
  result.scale = 1.25;
  return result;
}

// With keyframes of others.
inline Share global_share() {
  std::mt19937_64 random(4);
  Share result = share();
  KeyframeFeatures features{
      std::make_shared<const CameraGeometry>(CameraGeometry{320, 240, 260, 260, 160, 120, 0, 1.2, Pose3()}), {}, {}};
  for (std::uint16_t i = 0; i < 40; ++i) {
    features.points.push_back({static_cast<std::uint16_t>(16 * i), static_cast<std::uint16_t>(40 * i),
                               static_cast<std::uint16_t>(9 * i), 1, 3});
    features.descriptors.push_back({random(), random(), random(), random()});
  }
  SharedKeyframe whole{
      {kAlphaCamera, 7}, {{1.0, 2.0, 0.5}, Eigen::Quaterniond(0.5, 0.5, -0.5, 0.5)}, 1.5, features, {}};
  for (std::uint32_t i = 0; i < 10; ++i) whole.landmarks.push_back(landmark(random, 2 * i));
  SharedKeyframe light = whole;
  light.id.index = 8;
  light.scale = 1.0;
  light.features.reset();
  light.landmarks.clear();
  result.keyframes = {whole, light};
  result.dropped = {{kAlphaCamera, 3}, {{{RobotId("gamma"), SensorId("camera")}, 9}, 1}};
  result.number = 4;
  return result;
}

inline Sensed sensed(std::variant<PackedScan, Pose3, StreamEnd, InertialYaw, LostScan, MappedPart> body) {
  return {RobotId("alpha"), 7, {123456789}, std::move(body)};
}

inline PackedScan small_scan() {
  ScanGeometry geometry{-1.0, 0.5, 4, 30.0, 0.001, {}};
  geometry.robot_from_laser.t = {0.1, 0.0, 0.3};
  return {std::make_shared<const ScanGeometry>(geometry), {1000, 0, 2000, 29999}};
}

inline Hash hash_of(std::uint8_t number) {
  Hash hash;
  hash.bytes[0] = number;
  return hash;
}

inline MergedMaps merged_maps() {
  MergedMaps merged;
  merged.members = {MapId("alpha"), MapId("beta"), MapId("gamma")};
  merged.merges.push_back({{MapId("alpha")}, {MapId("beta")}, 0.75, "corners"});
  merged.merges.push_back({{MapId("gamma")}, {MapId("alpha"), MapId("beta")}, 1.0, "ring keys"});
  Judgement judgement;
  judgement.id = hash_of(7);
  judgement.a = {kAlphaLaser, 0};
  judgement.b = {kBetaLaser, 3};
  judgement.probability = 0.9;
  merged.judgements = {judgement};
  MatchedSubmaps match;
  match.from = {kBetaLaser, 3};
  match.to = {kAlphaLaser, 0};
  match.from_from_to = {1.5, -0.0, -3.0};
  match.information << 4, 1, 0, 1, 5, 2, 0, 2, 6;
  match.probability = 0.9;
  match.is_observable = false;
  match.overrules_own = true;
  match.judgement = hash_of(7);
  merged.matches = {match};
  merged.constraints = {planar_constraint({ConstraintKind::scan_match, {kAlphaLaser, 2}, {kBetaLaser, 0}, 1},
                                          {0.1, 0.2, 0.3}, Eigen::Vector3d(1, 2, 3).asDiagonal())};
  return merged;
}

inline std::vector<PairToJudge> some_pairs() {
  PairToJudge both{MapId("alpha"), MapId("beta"), {}, true};
  both.submaps.push_back({{kBetaLaser, 3}, {kAlphaLaser, 0}, {1.25, -2.5, 0.1}, 10.0, 3.14, false});
  both.submaps.push_back({{kAlphaLaser, 1}, {kBetaLaser, 2}, {-0.0, 0.1, -3.0}, 2.5, 0.2, true});
  return {both, {MapId("beta"), MapId("gamma"), {}, false}};
}

inline std::vector<Receipt> some_receipts() {
  return {{{TierId("north"), MapId("alpha")}, 7, 9}, {{TierId(), MapId("beta.camera")}, 0, 0}};
}

inline MapReport small_report() {
  MapReport report{RobotId("alpha"), 1200, {}};
  report.summary.left = -3;
  report.summary.bottom = 2;
  report.summary.columns = 3;
  report.summary.rows = 2;
  using Cell = MapSummary::Cell;
  report.summary.cells = {Cell::wall, Cell::free, Cell::unknown, Cell::free, Cell::free, Cell::wall};
  report.summary.looks.push_back({-120, 55, {1, 2, 3}});
  return report;
}

// Of scans: every list of an update that they know.
inline MapUpdate scan_update(std::uint64_t seed, std::uint32_t node_count) {
  RandomMaps random(seed);
  const Map map = random.map("alpha", node_count);
  MapUpdate update = difference({}, map);
  update.origin.tier = TierId("north");
  update.sequence = 3;
  update.base = 2;
  const SessionId other{{RobotId("aa"), SensorId("front.laser")}, -5};
  for (std::uint32_t i = 0; i < 3; ++i)
    update.judgements.push_back(random.judgement({other, i}, {map.sessions().front(), 0}));
  std::sort(update.judgements.begin(), update.judgements.end(),
            [](const auto& a, const auto& b) { return a.id < b.id; });
  update.moved = {{{other, 1}, random.pose()}, {{other, 4}, random.pose(true)}};
  update.removed_nodes = {{other, 7}, {other, 8}};
  update.removed_submaps = {{other, 0}};
  update.removed_constraints = {{ConstraintKind::prior, {other, 7}, {other, 7}, 2}};
  return update;
}

// Of keyframes and landmarks.
inline MapUpdate keyframe_update(std::uint64_t seed, std::uint32_t node_count) {
  RandomMaps random(seed);
  const Map map = random.keyframe_map("alpha", node_count), beta = random.keyframe_map("beta", 2);
  MapUpdate update = difference({}, map);
  update.landmarks[1].seen.push_back(random.sighting(beta.nodes.front().first));
  const SessionId session = map.nodes.front().first.session;
  update.changed_landmarks = {
      {{session, 500}, Eigen::Vector3i{1, -2147483647, 0}, {}},
      {{session, 501}, std::nullopt, {random.sighting({session, 1}), random.sighting({session, 9})}},
      {{session, 502}, Eigen::Vector3i{-3, 3, 70000}, {random.sighting(beta.nodes.front().first)}}};
  update.removed_landmarks = {{session, 600}, {session, 601}};
  return update;
}

// As clients publish them: from above to below, in 0.001 / m and 64ths of a turn.
inline MapUpdate of_a_client(std::uint64_t seed, std::uint32_t features) {
  RandomMaps random(seed);
  MapUpdate update;
  update.origin = {TierId("alpha"), MapId("alpha")};
  auto payload = random.keyframe(random.camera(), features);
  KeyframeFeatures keyframe = std::get<KeyframeFeatures>(*payload);
  for (KeyframePoint& point : keyframe.points) {
    point.angle &= 0xfc;
    point.inverse_depth = static_cast<std::uint16_t>(point.inverse_depth / 8 & 0xfffc);
  }
  std::sort(keyframe.points.begin(), keyframe.points.end(), [](const auto& a, const auto& b) { return a.v < b.v; });
  update.nodes = {
      {{{{RobotId("alpha"), SensorId("camera")}, 1}, 0}, {}, random.pose(), std::make_shared<const Payload>(keyframe)}};
  return update;
}

}  // namespace mapweave::test
