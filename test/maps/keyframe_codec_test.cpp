#include "messages.h"

#include <gmock/gmock.h>
#include <mapweave/core/error.h>

#include <cstring>
#include <functional>
#include <limits>
#include <set>

namespace mapweave {
namespace {

using test::keyframe_update;
using test::of_a_client;
using test::RandomMaps;
using ::testing::HasSubstr;

bool is_refused(std::string_view bytes) {
  try {
    decode_map_update(bytes, "here");
    return false;
  } catch (const Error& error) {
    EXPECT_TRUE(error.code() == ErrorCode::kCorrupt || error.code() == ErrorCode::kUnsupported) << error.what();
    return true;
  }
}

std::uint32_t version_of(const MapUpdate& update) {
  const std::string bytes = encode(update);
  return static_cast<std::uint32_t>(bytes[bytes.find('\x08') + 1]);
}

void expect_same(const LandmarkSighting& a, const LandmarkSighting& b) {
  EXPECT_EQ(a.node, b.node);
  EXPECT_EQ(std::tie(a.u, a.v, a.inverse_depth, a.level), std::tie(b.u, b.v, b.inverse_depth, b.level));
}

TEST(KeyframeCodec, gives_keyframes_back_bit_for_bit) {
  const MapUpdate update = keyframe_update(1, 20), again = decode_map_update(encode(update), "here");
  ASSERT_EQ(again.nodes.size(), update.nodes.size());
  std::set<const CameraGeometry*> cameras;
  for (std::size_t i = 0; i < update.nodes.size(); ++i) {
    const auto* before = std::get_if<KeyframeFeatures>(update.nodes[i].payload.get());
    const auto* after = std::get_if<KeyframeFeatures>(again.nodes[i].payload.get());
    ASSERT_EQ(before == nullptr, after == nullptr);
    if (before == nullptr) continue;
    EXPECT_TRUE(*before->geometry == *after->geometry);
    EXPECT_EQ(before->descriptors, after->descriptors);
    ASSERT_EQ(before->points.size(), after->points.size());
    EXPECT_EQ(std::memcmp(before->points.data(), after->points.data(), 8 * before->points.size()), 0);
    cameras.insert(after->geometry.get());
  }
  EXPECT_EQ(cameras.size(), 2U) << "cameras are shared again";
  EXPECT_EQ(encode(again), encode(update));
}

TEST(KeyframeCodec, gives_landmarks_back_bit_for_bit) {
  const MapUpdate update = keyframe_update(2, 20), again = decode_map_update(encode(update), "here");
  ASSERT_EQ(again.landmarks.size(), update.landmarks.size());
  for (std::size_t i = 0; i < update.landmarks.size(); ++i) {
    const Landmark &before = update.landmarks[i], &after = again.landmarks[i];
    EXPECT_EQ(after.id, before.id);
    EXPECT_EQ(after.anchor, before.anchor);
    EXPECT_EQ(after.point_units, before.point_units);
    EXPECT_EQ(after.colour, before.colour);
    ASSERT_EQ(after.seen.size(), before.seen.size());
    for (std::size_t k = 0; k < before.seen.size(); ++k) expect_same(after.seen[k], before.seen[k]);
  }
  ASSERT_EQ(again.changed_landmarks.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(again.changed_landmarks[i].point_units, update.changed_landmarks[i].point_units);
    ASSERT_EQ(again.changed_landmarks[i].seen.size(), update.changed_landmarks[i].seen.size());
    for (std::size_t k = 0; k < again.changed_landmarks[i].seen.size(); ++k)
      expect_same(again.changed_landmarks[i].seen[k], update.changed_landmarks[i].seen[k]);
  }
  EXPECT_EQ(again.removed_landmarks, update.removed_landmarks);
}

TEST(KeyframeCodec, gives_a_keyframe_without_features_back) {
  RandomMaps random(2);
  MapUpdate update;
  update.nodes = {
      {{{{RobotId("alpha"), SensorId("camera")}, 1}, 0}, {}, random.pose(), random.keyframe(random.camera(), 0)}};
  const MapUpdate again = decode_map_update(encode(update), "here");
  ASSERT_NE(std::get_if<KeyframeFeatures>(again.nodes[0].payload.get()), nullptr);
}

TEST(KeyframeCodec, takes_the_oldest_form_that_says_it_all) {
  EXPECT_EQ(version_of(difference({}, RandomMaps(1).map("alpha", 12))), 1U);
  const MapUpdate update = keyframe_update(1, 5);
  EXPECT_EQ(version_of(update), 2U);
  MapUpdate part;
  part.nodes = {update.nodes[3]};
  EXPECT_EQ(version_of(part), 1U) << "a pose only";
  part.nodes = {update.nodes[2]};
  EXPECT_EQ(version_of(part), 2U);
  part = {};
  part.removed_landmarks = update.removed_landmarks;
  EXPECT_EQ(version_of(part), 2U);
  part.borrowed = {update.changed_landmarks[1]};
  EXPECT_EQ(version_of(part), 3U);
}

TEST(KeyframeCodec, gives_sightings_of_borrowed_landmarks_back) {
  MapUpdate update = keyframe_update(1, 20);
  update.borrowed = {update.changed_landmarks[1]};
  update.borrowed[0].id.session.client.robot = RobotId("beta");
  const MapUpdate again = decode_map_update(encode(update), "here");
  ASSERT_EQ(again.borrowed.size(), 1U);
  EXPECT_EQ(again.borrowed[0].id, update.borrowed[0].id);
  ASSERT_EQ(again.borrowed[0].seen.size(), 2U);
  for (std::size_t k = 0; k < 2; ++k) expect_same(again.borrowed[0].seen[k], update.borrowed[0].seen[k]);
  const std::string bytes = encode(update);
  for (std::size_t length = 0; length < bytes.size(); length += 7)
    EXPECT_TRUE(is_refused(bytes.substr(0, length))) << length;
}

// CORB-SLAM sends light keyframes after the first full one; ours say 1/45 of a full one's bytes or less.
TEST(KeyframeCodec, spends_forty_bytes_on_a_feature_and_little_on_a_light_keyframe) {
  RandomMaps random(2);
  const auto camera = random.camera();
  const SessionId session{{RobotId("alpha"), SensorId("camera")}, 976052857217000000};
  const auto size_of = [&](std::uint32_t count, bool is_full) {
    MapUpdate update;
    update.origin = {TierId("alpha"), MapId("alpha")};
    for (std::uint32_t i = 0; i < count; ++i) {
      const NodeId id{session, 1000 + i};
      if (is_full)
        update.nodes.push_back({id, {session.run + i * 200'000'000LL}, random.pose(), random.keyframe(camera, 500)});
      else
        update.moved.push_back({id, random.pose()});
    }
    return encode(update).size();
  };
  const std::size_t full = size_of(2, true) - size_of(1, true), light = size_of(2, false) - size_of(1, false);
  EXPECT_LE(full, 500U * 40U + 100U);
  EXPECT_LE(45 * light, full);
  EXPECT_LE(45 * size_of(1, false), size_of(1, true)) << "also when it travels alone";
}

bool same_points(const MapUpdate& a, const MapUpdate& b) {
  const auto& one = std::get<KeyframeFeatures>(*a.nodes[0].payload);
  const auto& other = std::get<KeyframeFeatures>(*b.nodes[0].payload);
  return one.points.size() == other.points.size() && one.descriptors == other.descriptors &&
         std::memcmp(one.points.data(), other.points.data(), 8 * one.points.size()) == 0;
}

TEST(KeyframeCodec, spends_thirty_seven_bytes_on_a_feature_that_a_client_publishes) {
  const MapUpdate update = of_a_client(1, 1000);
  EXPECT_EQ(version_of(update), 4U);
  const std::string bytes = encode(update);
  EXPECT_LT(bytes.size(), 37U * 1000U + 300U);
  const MapUpdate again = decode_map_update(bytes, "here");
  EXPECT_TRUE(same_points(again, update));
  EXPECT_EQ(encode(again), bytes);
}

TEST(KeyframeCodec, gives_back_any_points_that_rise) {
  for (std::uint64_t seed = 1; seed < 30; ++seed) {
    MapUpdate update = of_a_client(seed, 16 + static_cast<std::uint32_t>(seed));
    KeyframeFeatures keyframe = std::get<KeyframeFeatures>(*update.nodes[0].payload);
    if (seed % 3 == 0) {
      keyframe.points.back().v = 16 * 479;
      keyframe.points.back().u = 1;
      keyframe.points.back().inverse_depth = 65535;
    }
    if (seed % 3 == 1)
      for (KeyframePoint& point : keyframe.points) point = {};
    if (seed % 5 == 0) keyframe.points.back().angle = 255;
    update.nodes[0].payload = std::make_shared<const Payload>(keyframe);
    EXPECT_TRUE(same_points(decode_map_update(encode(update), "here"), update)) << seed;
  }
}

TEST(KeyframeCodec, refuses_dense_points_that_are_cut_changed_or_too_long) {
  const std::string bytes = encode(of_a_client(3, 40));
  for (std::size_t length = 0; length < bytes.size(); ++length)
    EXPECT_TRUE(is_refused(bytes.substr(0, length))) << length;
  std::size_t refused = 0;
  for (std::size_t i = 0; i < bytes.size(); ++i)
    for (const int bit : {0, 3, 7}) {
      std::string changed = bytes;
      changed[i] = static_cast<char>(changed[i] ^ 1 << bit);
      refused += is_refused(changed);  // what is read is sound, or it is refused
    }
  EXPECT_GT(refused, 100U);
}

TEST(KeyframeCodec, spends_little_on_a_landmark) {
  RandomMaps random(2);
  const SessionId session{{RobotId("alpha"), SensorId("camera")}, 976052857217000000};
  MapUpdate whole, seen_again, moved;
  for (std::uint32_t i = 0; i < 1000; ++i) {
    Landmark landmark;
    landmark.id = {session, 5000 + i};
    landmark.anchor = {session, 300};
    landmark.point_units = landmark_units({random.uniform(-20, 20), random.uniform(-20, 20), random.uniform(-2, 2)});
    landmark.colour = {200, 100, 50};
    landmark.seen = {random.sighting({session, 300}), random.sighting({session, 303})};
    whole.landmarks.push_back(landmark);
    seen_again.changed_landmarks.push_back({landmark.id, std::nullopt, {random.sighting({session, 310})}});
    moved.changed_landmarks.push_back({landmark.id, landmark.point_units, {}});
  }
  EXPECT_LE(encode(whole).size(), 1000U * 52U);
  EXPECT_LE(encode(seen_again).size(), 1000U * 23U);
  EXPECT_LE(encode(moved).size(), 1000U * 21U);
}

TEST(KeyframeCodec, notices_an_update_cut_at_any_byte) {
  const std::string bytes = encode(keyframe_update(4, 5));
  for (std::size_t size = 0; size < bytes.size(); ++size)
    ASSERT_TRUE(is_refused(std::string_view(bytes).substr(0, size))) << size;
}

TEST(KeyframeCodec, survives_any_flipped_bit) {
  const std::string bytes = encode(keyframe_update(4, 5));
  int refused = 0;
  for (std::size_t bit = 0; bit < 8 * bytes.size(); ++bit) {
    std::string damaged = bytes;
    damaged[bit / 8] = static_cast<char>(damaged[bit / 8] ^ 1 << bit % 8);
    refused += is_refused(damaged) ? 1 : 0;
  }
  EXPECT_GT(refused, 1000);
}

// A field of bytes, as protobuf writes it; up to 16 kB.
std::string field(int number, const std::string& content) {
  std::string bytes(1, static_cast<char>(number << 3 | 2));
  if (content.size() >= 0x80) bytes.push_back(static_cast<char>((content.size() & 0x7f) | 0x80));
  bytes.push_back(static_cast<char>(content.size() >= 0x80 ? content.size() >> 7 : content.size()));
  return bytes + content;
}

class HandMadeUpdate : public ::testing::Test {
 protected:
  HandMadeUpdate() {
    MapUpdate update;
    update.nodes = {{{{{RobotId("alpha"), SensorId("camera")}, 1}, 0}, {}, {}, random_.keyframe(random_.camera(), 0)}};
    const std::string bytes = encode(update);
    header_ = bytes.substr(0, bytes.size() - field(2, node(field(6, ""))).size());
  }
  static std::string node(const std::string& payload) {
    const std::string identity("\x39\0\0\0\0\0\0\xf0\x3f", 9);  // qw = 1
    return field(1, "") + std::string("\x10\x01", 2) + field(3, identity) + payload;
  }
  bool takes_keyframe(std::size_t point_bytes, std::size_t descriptor_bytes) const {
    const std::string keyframe =
        field(2, std::string(point_bytes, '\0')) + field(3, std::string(descriptor_bytes, '\0'));
    return !is_refused(header_ + field(2, node(field(6, keyframe))));
  }
  bool takes_landmark(std::size_t numbers, std::size_t nodes, std::size_t sessions, std::size_t place_bytes) const {
    std::string indices;
    for (std::size_t i = 0; i < nodes; ++i) indices.push_back(static_cast<char>(i));
    return !is_refused(header_ + field(10, field(1, "") + field(3, std::string(numbers, '\2')) +
                                               field(5, std::string(sessions, '\0')) + field(6, indices) +
                                               field(7, std::string(place_bytes, '\0'))));
  }
  RandomMaps random_{3};
  std::string header_;
};

TEST_F(HandMadeUpdate, is_refused_when_points_and_descriptors_disagree) {
  EXPECT_TRUE(takes_keyframe(0, 0));
  EXPECT_TRUE(takes_keyframe(8, 32));
  EXPECT_TRUE(takes_keyframe(80, 320));
  EXPECT_FALSE(takes_keyframe(80, 319)) << "a descriptor of the wrong length";
  EXPECT_FALSE(takes_keyframe(80, 288));
  EXPECT_FALSE(takes_keyframe(79, 320));
  EXPECT_FALSE(takes_keyframe(80, 0));
  EXPECT_FALSE(takes_keyframe(0, 32));
}

TEST_F(HandMadeUpdate, is_refused_when_a_camera_is_not_in_its_table) {
  EXPECT_TRUE(is_refused(header_ + field(2, node(field(6, std::string("\x08\x01", 2))))));
}

TEST_F(HandMadeUpdate, is_refused_when_counts_of_sightings_disagree) {
  EXPECT_TRUE(takes_landmark(3, 0, 0, 0));
  EXPECT_TRUE(takes_landmark(3, 5, 0, 35));
  EXPECT_TRUE(takes_landmark(3, 5, 5, 35));
  EXPECT_FALSE(takes_landmark(3, 5, 0, 34));
  EXPECT_FALSE(takes_landmark(3, 5, 4, 35));
  EXPECT_FALSE(takes_landmark(3, 4, 0, 35));
  EXPECT_FALSE(takes_landmark(3, 4, 5, 28));
  EXPECT_FALSE(takes_landmark(2, 0, 0, 0)) << "a point of two numbers";
  EXPECT_FALSE(takes_landmark(0, 0, 0, 0));
}

// What encode would not write, decode would not read: the rules are the same list (soundness.h).
TEST(KeyframeCodec, writes_nothing_that_could_not_be_read) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  const auto refuses = [](const std::string& what, const std::function<void(MapUpdate&)>& spoil) {
    MapUpdate update = keyframe_update(4, 5);
    EXPECT_NO_THROW(encode(update));
    spoil(update);
    EXPECT_THROW(encode(update), ContractViolation) << what;
  };
  const auto refuses_keyframe = [&](const std::string& what,
                                    const std::function<void(KeyframeFeatures&, CameraGeometry&)>& spoil) {
    refuses(what, [&](MapUpdate& update) {
      KeyframeFeatures keyframe = std::get<KeyframeFeatures>(*update.nodes[0].payload);
      CameraGeometry camera = *keyframe.geometry;
      spoil(keyframe, camera);
      keyframe.geometry = std::make_shared<const CameraGeometry>(camera);
      update.nodes[0].payload = std::make_shared<const Payload>(keyframe);
    });
  };
  refuses_keyframe("a missing descriptor", [](KeyframeFeatures& k, CameraGeometry&) { k.descriptors.pop_back(); });
  refuses_keyframe("a missing point", [](KeyframeFeatures& k, CameraGeometry&) { k.points.pop_back(); });
  refuses_keyframe("a point outside", [](KeyframeFeatures& k, CameraGeometry&) { k.points[0].v = 16 * 480; });
  refuses_keyframe("level 32", [](KeyframeFeatures& k, CameraGeometry&) { k.points[0].level = 32; });
  refuses_keyframe("too many features", [](KeyframeFeatures& k, CameraGeometry&) {
    k.points.resize(100001);
    k.descriptors.resize(100001);
  });
  refuses_keyframe("no width", [](KeyframeFeatures& k, CameraGeometry& c) {
    c.width = 0;
    k.points.clear();
    k.descriptors.clear();
  });
  refuses_keyframe("a large picture", [](KeyframeFeatures&, CameraGeometry& c) { c.height = 4097; });
  refuses_keyframe("NaN as focal length", [&](KeyframeFeatures&, CameraGeometry& c) { c.fy = nan; });
  refuses_keyframe("a focal length of 0", [&](KeyframeFeatures&, CameraGeometry& c) { c.fx = 0; });
  refuses_keyframe("an infinite centre", [](KeyframeFeatures&, CameraGeometry& c) { c.cx = INFINITY; });
  refuses_keyframe("a negative baseline", [](KeyframeFeatures&, CameraGeometry& c) { c.baseline_m = -0.1; });
  refuses_keyframe("a pyramid that shrinks", [](KeyframeFeatures&, CameraGeometry& c) { c.level_scale = 0.9; });
  refuses_keyframe("NaN in a mount", [&](KeyframeFeatures&, CameraGeometry& c) { c.robot_from_camera.t.x() = nan; });
  refuses("a keyframe without camera",
          [](MapUpdate& u) { u.nodes[0].payload = std::make_shared<const Payload>(KeyframeFeatures{}); });
  refuses("a foreign anchor", [](MapUpdate& u) { u.landmarks[0].anchor.session.run += 1; });
  refuses("sightings out of order", [](MapUpdate& u) { std::swap(u.landmarks[0].seen[0], u.landmarks[0].seen[1]); });
  refuses("a sighting twice", [](MapUpdate& u) { u.changed_landmarks[1].seen[1] = u.changed_landmarks[1].seen[0]; });
  refuses("a sighting on level 40", [](MapUpdate& u) { u.changed_landmarks[1].seen[1].level = 40; });
  refuses("a borrowed landmark that moves", [](MapUpdate& u) { u.borrowed = {u.changed_landmarks[0]}; });
  refuses("borrowed landmarks out of order", [](MapUpdate& u) {
    u.borrowed = {u.changed_landmarks[1], u.changed_landmarks[1]};
  });
  refuses("landmarks out of order", [](MapUpdate& u) { std::swap(u.landmarks[0], u.landmarks[1]); });
  refuses("a robot without a name", [](MapUpdate& u) { u.removed_landmarks[0].session.client.robot = RobotId(); });
}

}  // namespace
}  // namespace mapweave
