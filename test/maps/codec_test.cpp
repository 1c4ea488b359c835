#include "messages.h"

#include <gmock/gmock.h>
#include <mapweave/core/error.h>
#include <mapweave/maps/in_floats.h>

#include <Eigen/Eigenvalues>
#include <cstring>
#include <functional>
#include <set>

namespace mapweave {
namespace {

using test::RandomMaps;
using test::scan_update;
using ::testing::HasSubstr;

Map map_of(const MapUpdate& update) { return updated({}, update); }

// Decodes what may be damaged: nothing but Error may come out of it.
template <class Decode>
bool is_refused(const Decode& decode, std::string_view bytes) {
  try {
    decode(bytes, "here");
    return false;
  } catch (const Error& error) {
    EXPECT_TRUE(error.code() == ErrorCode::kCorrupt || error.code() == ErrorCode::kUnsupported) << error.what();
    EXPECT_THAT(error.where(), HasSubstr("here"));
    return true;
  }
}

TEST(Codec, gives_maps_back_bit_for_bit) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    const Map map = RandomMaps(seed).map("alpha", static_cast<std::uint32_t>(3 * seed));
    const Map again = map_of(decode_map_update(encode(difference({}, map)), "here"));
    ASSERT_EQ(again.id, map.id);
    ASSERT_EQ(content_hash(again), content_hash(map));
    ASSERT_EQ(again.nodes.size(), map.nodes.size());
    for (const auto& [id, node] : map.nodes) {
      const Node* other = again.nodes.find(id);
      ASSERT_NE(other, nullptr);
      EXPECT_EQ(std::memcmp(other->map_from_node.t.data(), node.map_from_node.t.data(), 24), 0);
      EXPECT_EQ(std::memcmp(other->map_from_node.q.coeffs().data(), node.map_from_node.q.coeffs().data(), 32), 0);
      EXPECT_EQ(other->stamp, node.stamp);
    }
    ASSERT_EQ(again.constraints.size(), map.constraints.size());
    for (const auto& [id, constraint] : map.constraints) {
      const Constraint* other = again.constraints.find(id);
      ASSERT_NE(other, nullptr);
      EXPECT_EQ(std::memcmp(other->information.data(), constraint.information.data(), 36 * 8), 0);
      EXPECT_EQ(other->from_from_to.scale, constraint.from_from_to.scale);
      EXPECT_EQ(other->because, constraint.because);
    }
  }
}

TEST(Codec, gives_every_list_of_an_update_back) {
  const MapUpdate update = scan_update(5, 30);
  const MapUpdate again = decode_map_update(encode(update), "here");
  EXPECT_EQ(encode(again), encode(update));
  EXPECT_EQ(again.origin.tier, TierId("north"));
  EXPECT_EQ(again.sequence, 3U);
  EXPECT_EQ(again.base, 2U);
  EXPECT_EQ(again.moved.size(), 2U);
  EXPECT_EQ(again.judgements.size(), 3U);
  EXPECT_EQ(again.removed_nodes, update.removed_nodes);
  EXPECT_EQ(again.removed_submaps, update.removed_submaps);
  EXPECT_EQ(again.removed_constraints, update.removed_constraints);
}

TEST(Codec, keeps_the_sign_of_zero_and_the_smallest_numbers) {
  MapUpdate update = scan_update(5, 3);
  update.nodes[0].map_from_node.t = {-0.0, std::numeric_limits<double>::denorm_min(),
                                     std::numeric_limits<double>::max()};
  const MapUpdate again = decode_map_update(encode(update), "here");
  EXPECT_EQ(std::memcmp(again.nodes[0].map_from_node.t.data(), update.nodes[0].map_from_node.t.data(), 24), 0);
}

TEST(Codec, writes_floats_where_they_say_the_same) {
  MapUpdate update = scan_update(5, 40);
  const auto bytes_with = [&](bool in_floats) {
    update.in_floats = in_floats;
    return encode(update);
  };
  EXPECT_EQ(bytes_with(true).size(), bytes_with(false).size()) << "random doubles are no floats";
  for (Node& node : update.nodes) node.map_from_node = in_floats(node.map_from_node);
  for (Constraint& constraint : update.constraints)
    constraint = planar_constraint(constraint.id, in_floats(planar(constraint.from_from_to.pose)),
                                   in_floats(Eigen::Matrix3d::Identity() * 7.3));
  const std::string whole = bytes_with(false), rounded = bytes_with(true);
  EXPECT_LT(rounded.size() + 15 * update.nodes.size() + 35 * update.constraints.size(), whole.size());
  EXPECT_EQ(encode(decode_map_update(rounded, "here")), whole) << "the same numbers, bit for bit";
}

TEST(InFloats, information_stays_without_a_negative_direction) {
  RandomMaps random(9);
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector3d pull(random.uniform(-1e3, 1e3), random.uniform(-1e-2, 1e-2), random.uniform(-30, 30));
    const Eigen::Matrix3d rounded = in_floats(Eigen::Matrix3d(pull * pull.transpose()));  // of rank one
    const Eigen::Vector3d weights = rounded.diagonal().cwiseSqrt().cwiseInverse();
    const Eigen::Matrix3d even = weights.asDiagonal() * rounded * weights.asDiagonal();
    EXPECT_GE(Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d>(even).eigenvalues().minCoeff(), 0.0);
  }
}

TEST(Codec, gives_judgements_and_verdicts_back) {
  RandomMaps random(3);
  const SessionId session{{RobotId("alpha"), SensorId("laser")}, 12};
  for (int i = 0; i < 20; ++i) {
    const Judgement judgement = random.judgement({session, 1}, {session, 2});
    const Judgement again = decode_judgement(encode(judgement), "here");
    EXPECT_EQ(encode(again), encode(judgement));
    EXPECT_EQ(again.id, judgement.id);
    EXPECT_EQ(again.b, judgement.b);
    EXPECT_EQ(again.scores, judgement.scores);
    EXPECT_EQ(again.doubt, judgement.doubt);
    EXPECT_EQ(again.evidence.observability, judgement.evidence.observability);

    Verdict verdict = random.verdict(MapId("a"), MapId("b"));
    verdict.seconds = 1.5;
    const Verdict verdict_again = decode_verdict(encode(verdict), "here");
    EXPECT_EQ(encode(verdict_again), encode(verdict));
    EXPECT_EQ(verdict_again.decision, verdict.decision);
    EXPECT_EQ(verdict_again.alignment.has_value(), verdict.alignment.has_value());
    EXPECT_EQ(verdict_again.witnesses, verdict.witnesses);
    EXPECT_EQ(verdict_again.seconds, 0.0) << "times are no part of a sealed result";
  }
}

TEST(Codec, shares_geometries_again) {
  Map map = RandomMaps(2).map("alpha", 40);
  for (auto& [id, node] : map.nodes) {  // as if every scan had brought its own
    if (node.payload == nullptr || !std::holds_alternative<PackedScan>(*node.payload)) continue;
    PackedScan scan = std::get<PackedScan>(*node.payload);
    scan.geometry = std::make_shared<const ScanGeometry>(*scan.geometry);
    node.payload = std::make_shared<const Payload>(scan);
  }
  const Map again = map_of(decode_map_update(encode(difference({}, map)), "here"));
  std::set<const ScanGeometry*> geometries;
  for (const auto& [id, node] : again.nodes)
    if (node.payload != nullptr && std::holds_alternative<PackedScan>(*node.payload))
      geometries.insert(std::get<PackedScan>(*node.payload).geometry.get());
  EXPECT_EQ(geometries.size(), 2U);
}

TEST(Codec, keeps_the_motion_within_scans_and_says_so_in_its_version_only_there) {
  const Map plain = RandomMaps(2).map("alpha", 12);
  Map bent = plain;
  std::int16_t motion = 100;
  for (auto& [id, node] : bent.nodes) {
    if (node.payload == nullptr || !std::holds_alternative<PackedScan>(*node.payload)) continue;
    PackedScan scan = std::get<PackedScan>(*node.payload);
    auto geometry = std::make_shared<ScanGeometry>(*scan.geometry);
    geometry->first_ray_s = -0.02;
    geometry->ray_step_s = 1e-4;
    scan.geometry = geometry;
    scan.motion = {motion, static_cast<std::int16_t>(-motion), static_cast<std::int16_t>(7 * motion)};
    ++motion;
    node.payload = std::make_shared<const Payload>(scan);
  }
  ASSERT_GT(motion, 100);
  for (auto& [id, submap] : bent.submaps)
    if (submap.frozen) submap.content = content_hash(submap, bent.nodes);
  EXPECT_NE(content_hash(bent), content_hash(plain));
  const std::string bytes = encode(difference({}, bent)), before = encode(difference({}, plain));
  EXPECT_EQ(bytes[bytes.find('\x08') + 1], 5);
  EXPECT_EQ(before[before.find('\x08') + 1], 1) << "older programs read what has no sweep";
  EXPECT_EQ(content_hash(map_of(decode_map_update(bytes, "here"))), content_hash(bent));
  EXPECT_EQ(encode(difference({}, map_of(decode_map_update(bytes, "here")))), bytes);
}

TEST(Codec, spends_little_on_a_planar_node_beside_its_ranges) {
  MapUpdate update;
  RandomMaps random(2);
  const auto geometry = random.geometry(180);
  const SessionId session{{RobotId("alpha"), SensorId("laser")}, 976052857217000000};
  for (std::uint32_t i = 0; i < 1000; ++i)
    update.nodes.push_back({{session, i}, {session.run + i * 200'000'000LL}, random.pose(true), random.scan(geometry)});
  EXPECT_LT(encode(update).size() / 1000, 360U + 70U);
}

TEST(Codec, notices_an_update_cut_at_any_byte) {
  const std::string bytes = encode(scan_update(4, 12));
  for (std::size_t size = 0; size < bytes.size(); ++size)
    ASSERT_TRUE(is_refused(decode_map_update, std::string_view(bytes).substr(0, size))) << size;
}

TEST(Codec, survives_any_flipped_bit) {
  const std::string bytes = encode(scan_update(4, 7));
  int refused = 0;
  for (std::size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    std::string damaged = bytes;
    damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ 1 << bit % 8);
    refused += is_refused(decode_map_update, damaged) ? 1 : 0;
  }
  EXPECT_GT(refused, static_cast<int>(bytes.size()));
}

TEST(Codec, survives_random_damage_to_judgements_and_verdicts) {
  RandomMaps random(3);
  const SessionId session{{RobotId("alpha"), SensorId("laser")}, 12};
  Judgement judgement = random.judgement({session, 1}, {session, 2});
  judgement.hypotheses = {random.alignment()};
  judgement.scores = {0.5};
  Verdict verdict = random.verdict(MapId("a"), MapId("b"));
  verdict.alignment = random.alignment();
  const std::string judged = encode(judgement), decided = encode(verdict);
  for (std::size_t bit = 0; bit < 8 * judged.size(); ++bit) {
    std::string damaged = judged;
    damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ 1 << bit % 8);
    is_refused(decode_judgement, damaged);
    is_refused(decode_judgement, std::string_view(judged).substr(0, bit / 8));
  }
  for (std::size_t bit = 0; bit < 8 * decided.size(); ++bit) {
    std::string damaged = decided;
    damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ 1 << bit % 8);
    is_refused(decode_verdict, damaged);
    is_refused(decode_verdict, std::string_view(decided).substr(0, bit / 8));
  }
}

TEST(Codec, survives_bytes_of_nothing_in_particular) {
  RandomMaps random(11);
  for (int i = 0; i < 2000; ++i) {
    std::string bytes(random.below(200), '\0');
    for (char& byte : bytes) byte = static_cast<char>(random.below(256));
    EXPECT_TRUE(is_refused(decode_map_update, bytes));
    is_refused(decode_judgement, bytes);
    is_refused(decode_verdict, bytes);
  }
}

TEST(Codec, refuses_a_newer_form_and_says_so) {
  std::string bytes = encode(scan_update(4, 3));
  ASSERT_EQ(bytes.substr(3 - (bytes[1] & 0x80 ? 0 : 1), 2), std::string("\x08\x01"))
      << "the header begins with its version";
  bytes[bytes.find('\x08') + 1] = 9;
  try {
    decode_map_update(bytes, "team.mwdb");
    FAIL();
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kUnsupported);
    EXPECT_THAT(error.what(), ::testing::AllOf(HasSubstr("team.mwdb"), HasSubstr("form 9"), HasSubstr("up to 7"),
                                               HasSubstr("newer mapweave")));
  }
}

TEST(Codec, says_what_its_sender_has_forgotten_in_a_form_of_its_own) {
  MapUpdate update = scan_update(4, 3);
  const std::string before = encode(update);
  const SessionId session = update.nodes.front().id.session;
  update.forgotten_nodes = {{session, 2}, {session, 7}};
  update.forgotten_landmarks = {{session, 5}};
  const std::string bytes = encode(update);
  EXPECT_EQ(bytes[bytes.find('\x08') + 1], 6);
  EXPECT_LT(bytes.size(), before.size() + 30U);
  const MapUpdate back = decode_map_update(bytes, "test");
  EXPECT_EQ(back.forgotten_nodes, update.forgotten_nodes);
  EXPECT_EQ(back.forgotten_landmarks, update.forgotten_landmarks);
  EXPECT_EQ(encode(back), bytes);
  std::swap(update.forgotten_nodes[0], update.forgotten_nodes[1]);
  EXPECT_THROW(encode(update), ContractViolation);
}

TEST(Codec, names_the_byte_where_an_update_is_damaged) {
  const std::string bytes = encode(scan_update(4, 12));
  try {
    decode_map_update(std::string_view(bytes).substr(0, bytes.size() - 1), "team.mwdb");
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(),
                ::testing::MatchesRegex("team\\.mwdb, byte [0-9]+: a field needs [0-9]+ bytes, [0-9]+ remain.*"));
  }
}

TEST(Codec, normalises_a_quaternion_that_is_a_little_off) {
  MapUpdate update = scan_update(4, 3);
  update.nodes[0].map_from_node.q.coeffs() *= 1.0 + 1e-8;
  const MapUpdate again = decode_map_update(encode(update), "here");
  EXPECT_NEAR(again.nodes[0].map_from_node.q.norm(), 1.0, 1e-15);
}

// What encode would not write, decode would not read: the rules are the same list (soundness.h).
TEST(Codec, writes_nothing_that_could_not_be_read) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto refuses = [](const std::string& what, const std::function<void(MapUpdate&)>& spoil) {
    MapUpdate update = scan_update(4, 12);
    spoil(update);
    EXPECT_THROW(encode(update), ContractViolation) << what;
  };
  const auto first_scan = [](MapUpdate& update, const std::function<void(PackedScan&, ScanGeometry&)>& spoil) {
    PackedScan scan = std::get<PackedScan>(*update.nodes[0].payload);
    ScanGeometry geometry = *scan.geometry;
    spoil(scan, geometry);
    scan.geometry = std::make_shared<const ScanGeometry>(geometry);
    update.nodes[0].payload = std::make_shared<const Payload>(scan);
  };
  refuses("NaN in a pose", [&](MapUpdate& u) { u.nodes[0].map_from_node.t.y() = nan; });
  refuses("a quaternion that is not unit", [&](MapUpdate& u) { u.moved[0].map_from_node.q.coeffs() *= 1.001; });
  refuses("NaN in an information matrix", [&](MapUpdate& u) { u.constraints[0].information(5, 5) = nan; });
  refuses("a negative information", [&](MapUpdate& u) { u.constraints[0].information(5, 5) = -1; });
  refuses("a scale of zero", [&](MapUpdate& u) { u.constraints[0].from_from_to.scale = 0; });
  refuses("an unknown kind", [&](MapUpdate& u) { u.constraints.back().id.kind = static_cast<ConstraintKind>(6); });
  refuses("a submap of no nodes", [&](MapUpdate& u) { u.submaps[0].submap_from_node.clear(); });
  refuses("a submap with a node twice",
          [&](MapUpdate& u) { u.submaps[0].submap_from_node.push_back(u.submaps[0].submap_from_node[1]); });
  refuses("an anchor that is not at the origin",
          [&](MapUpdate& u) { u.submaps[0].submap_from_node[0].second.t.x() = 0.1; });
  refuses("nodes out of order", [&](MapUpdate& u) { std::swap(u.nodes[0], u.nodes[1]); });
  refuses("a node twice", [&](MapUpdate& u) { u.nodes.push_back(u.nodes.back()); });
  refuses("a robot without a name", [&](MapUpdate& u) { u.removed_nodes[0].session.client.robot = RobotId(); });
  refuses("a sensor named as a path",
          [&](MapUpdate& u) { u.removed_nodes[1].session.client.sensor = SensorId("../laser"); });
  refuses("a map named as a path", [&](MapUpdate& u) { u.origin.map = MapId("a/b"); });
  refuses("a probability of 2", [&](MapUpdate& u) { u.judgements[0].probability = 2; });
  refuses("scores without hypotheses", [&](MapUpdate& u) { u.judgements[0].scores.push_back(1); });
  refuses("a missing range",
          [&](MapUpdate& u) { first_scan(u, [](PackedScan& s, ScanGeometry&) { s.ranges.pop_back(); }); });
  refuses("no rays", [&](MapUpdate& u) {
    first_scan(u, [](PackedScan& s, ScanGeometry& g) {
      s.ranges.clear();
      g.ray_count = 0;
    });
  });
  refuses("an infinite range",
          [&](MapUpdate& u) { first_scan(u, [](PackedScan&, ScanGeometry& g) { g.max_range_m = INFINITY; }); });
  refuses("a grid of other size", [&](MapUpdate& u) {
    OccupancyGrid grid = std::get<OccupancyGrid>(*u.nodes[5].payload);
    grid.columns += 1;
    u.nodes[5].payload = std::make_shared<const Payload>(grid);
  });
  Verdict verdict = RandomMaps(1).verdict(MapId("a"), MapId("b"));
  for (const char* kind : {"laser", "vision", "laser and vision", "grid"}) {
    verdict.kind = kind;
    EXPECT_EQ(decode_verdict(encode(verdict), "here").kind, kind);
  }
  verdict.kind = "smell";
  EXPECT_THROW(encode(verdict), ContractViolation);
}

}  // namespace
}  // namespace mapweave
