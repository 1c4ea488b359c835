#include <gmock/gmock.h>
#include <mapweave/core/error.h>
#include <mapweave/maps/alignment.h>
#include <support/pose_matchers.h>
#include <support/random_map.h>

#include <cmath>
#include <functional>
#include <set>

namespace mapweave {
namespace {

using test::IsNear;
using test::RandomMaps;
using ::testing::ElementsAre;

TEST(PlanarConstraint, gives_back_what_it_was_built_from) {
  Eigen::Matrix3d information;
  information << 3, 1, 2, 1, 5, 4, 2, 4, 9;
  const Constraint constraint = planar_constraint({}, Pose2(1, -2, 3), information);
  EXPECT_EQ(planar(constraint.information), information);
  EXPECT_THAT(planar(constraint.from_from_to.pose), IsNear(Pose2(1, -2, 3), 1e-12, 1e-12));
  EXPECT_EQ(constraint.information(5, 5), 9) << "yaw is the last of the six";
  EXPECT_TRUE(constraint.information.row(2).isZero(0.0)) << "height is left open";
}

TEST(Map, lists_its_sessions_and_robots_in_order) {
  Map map;
  for (const char* robot : {"beta", "alpha"})
    for (const std::int64_t run : {9, 4})
      for (const std::uint32_t index : {1U, 0U}) {
        Node node;
        node.id = {{{RobotId(robot), SensorId("laser")}, run}, index};
        map.nodes.set(node.id, node);
      }
  const auto session = [](const char* robot, std::int64_t run) {
    return SessionId{{RobotId(robot), SensorId("laser")}, run};
  };
  EXPECT_THAT(map.sessions(),
              ElementsAre(session("alpha", 4), session("alpha", 9), session("beta", 4), session("beta", 9)));
  EXPECT_THAT(map.robots(), ElementsAre(RobotId("alpha"), RobotId("beta")));
}

TEST(ContentHash, does_not_see_belief) {
  Map map = RandomMaps(1).map("alpha", 30);
  const Hash before = content_hash(map);
  for (auto& entry : map.nodes) entry.second.map_from_node.t.x() += 1.0;
  map.constraints = {};
  EXPECT_EQ(content_hash(map), before);
}

TEST(ContentHash, sees_any_change_of_content) {
  const Map map = RandomMaps(1).map("alpha", 30);
  const Submap& submap = map.submaps.begin()->second;
  const NodeId id = submap.anchor();
  std::set<Hash> hashes = {content_hash(map)};
  const auto changed = [&](const std::function<void(Map&, Node&)>& change) {
    Map copy = map;
    change(copy, *copy.nodes.find(id));
    hashes.insert(content_hash(copy));
    return copy;
  };
  changed([](Map&, Node& node) { node.stamp.ns += 1; });
  const Map other_range = changed([](Map&, Node& node) {
    PackedScan scan = std::get<PackedScan>(*node.payload);
    scan.ranges[3] += 1;
    node.payload = std::make_shared<const Payload>(scan);
  });
  EXPECT_NE(content_hash(submap, other_range.nodes), submap.content);
  changed([](Map&, Node& node) {
    PackedScan scan = std::get<PackedScan>(*node.payload);
    ScanGeometry geometry = *scan.geometry;
    geometry.robot_from_laser.t.x() = std::nextafter(geometry.robot_from_laser.t.x(), 1e9);
    scan.geometry = std::make_shared<const ScanGeometry>(geometry);
    node.payload = std::make_shared<const Payload>(scan);
  });
  const Map bare = changed([](Map&, Node& node) { node.payload = nullptr; });
  EXPECT_THROW(content_hash(submap, bare.nodes), ContractViolation);
  changed([](Map& copy, Node&) { copy.submaps.erase(copy.submaps.front().first); });
  EXPECT_EQ(hashes.size(), 6U);
}

TEST(ToText, names_every_reason_and_decision) {
  std::set<std::string_view> texts;
  for (int reason = 0; reason <= static_cast<int>(Reason::too_few_witnesses); ++reason)
    texts.insert(to_text(static_cast<Reason>(reason)));
  EXPECT_EQ(texts.size(), 8U);
  EXPECT_EQ(texts.count("unknown"), 0U);
  EXPECT_EQ(to_text(Decision::accepted), "accepted");
  EXPECT_EQ(to_text(Decision::refused), "refused");
  EXPECT_EQ(to_text(Decision::deferred), "deferred");
}

TEST(Alignment, turned_around_has_the_covariance_of_the_inverse) {
  Alignment alignment;
  const Pose2 a_from_b{3.0, -2.0, 0.7};
  alignment.a_from_b.pose = spatial(a_from_b);
  Eigen::Matrix3d root;
  root << 0.01, 0, 0, 0.004, 0.02, 0, 0.001, -0.002, 0.003;
  alignment.covariance = spatial(Eigen::Matrix3d(root * root.transpose()));
  const Alignment turned = inverse(alignment);
  Eigen::Matrix3d expected = Eigen::Matrix3d::Zero();
  for (int k = 0; k < 3; ++k) {
    // To first order: what a small motion along each column of the root does to the inverse.
    const Eigen::Vector3d m = 1e-3 * root.col(k);
    const Pose2 moved = between(inverse(a_from_b), inverse(compose(a_from_b, {m(0), m(1), m(2)})));
    const Eigen::Vector3d back = Eigen::Vector3d(moved.x, moved.y, moved.phi) / 1e-3;
    expected += back * back.transpose();
  }
  EXPECT_LT((planar(turned.covariance) - expected).norm(), 1e-3 * expected.norm());
  EXPECT_NEAR(planar(turned.a_from_b.pose).phi, -0.7, 1e-12);
  EXPECT_LT((planar(inverse(turned).covariance) - planar(alignment.covariance)).norm(), 1e-12);
}

}  // namespace
}  // namespace mapweave
