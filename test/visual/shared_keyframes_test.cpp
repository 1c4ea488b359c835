// What a client believes of keyframes that others made.
#include <support/landmark_sharing.h>

#include <gmock/gmock.h>

namespace mapweave::visual {
namespace {

using test::StarryCorridor;

Pose3 at_m(double z) { return {{0.0, 0.0, z}, Eigen::Quaterniond::Identity()}; }

struct Driven {
  VisualClient client;
  ClientPlace place;
  std::vector<Pose3> truth;
  explicit Driven(const char* robot, const ClientOptions& options = {})
      : client(StarryCorridor(0).camera, 0.0, options, matching::shipped_vocabulary()), place(test::place_of(robot)) {}
  void to(StarryCorridor& corridor, double from_m, double to_m) {
    const double step_m = from_m < to_m ? 0.05 : -0.05;
    for (double z = from_m; (to_m - z) * step_m > 0.0; z += step_m) {
      truth.push_back(at_m(z));
      client.add(corridor.frame(test::at(static_cast<int>(truth.size()) - 1), truth.back(), 0.2, 0.002));
    }
  }
};

// All keyframes of a map, as a server would share them with a client whose map has the same frame.
std::vector<SharedKeyframe> shared_of(const Map& map) {
  const matching::LandmarkDescriber describer(map);
  std::vector<SharedKeyframe> result;
  for (const auto& [id, node] : map.nodes) {
    const KeyframeFeatures& features = *keyframe_of(node);
    SharedKeyframe& one = result.emplace_back();
    one.id = id;
    one.map_from_camera = compose(node.map_from_node, features.geometry->robot_from_camera);
    one.features = features;
    for (const auto& [landmark_id, landmark] : map.landmarks)
      if (landmark.anchor == id)
        if (const auto known = describer.described(landmark)) one.landmarks.push_back(*known);
  }
  return result;
}

// Of alpha, who drove from 0 to 8 m.
const std::vector<SharedKeyframe>& keyframes_of_alpha() {
  static const std::vector<SharedKeyframe> shared = [] {
    StarryCorridor corridor(1);
    Driven alpha("alpha");
    alpha.to(corridor, 0.0, 8.0);
    return shared_of(alpha.client.maps(alpha.place).front());
  }();
  return shared;
}

TEST(SharedKeyframes, are_tracked_by_and_seen_as_what_others_made) {
  StarryCorridor corridor(2);
  Driven beta("beta");
  beta.to(corridor, 0.0, 0.2);
  const auto& shared = keyframes_of_alpha();
  ASSERT_GT(shared.size(), 5U);
  EXPECT_EQ(beta.client.keep_shared(beta.place, 0, shared, {}), static_cast<int>(shared.size()));
  beta.to(corridor, 0.2, 6.0);
  EXPECT_GT(beta.client.borrowed_seen(), 20U);
  EXPECT_LT(test::error_of(beta.client, beta.truth), 0.03);
  const SessionId own = *beta.client.run(beta.place);
  std::size_t borrowed = 0;
  for (const MapUpdate& update : beta.client.take_updates(beta.place, PublishedDetail::exact)) {
    for (const Node& node : update.nodes) EXPECT_EQ(node.id.session, own);
    for (const Landmark& landmark : update.landmarks) EXPECT_EQ(landmark.id.session, own);
    borrowed += update.borrowed.size();
  }
  EXPECT_GT(borrowed, 20U) << "as claimed sightings of others' landmarks";
  const auto kept = beta.client.shared_keyframes();
  ASSERT_EQ(kept.size(), shared.size());
  const Pose3 camera_from_robot = inverse(beta.place.robot_from_camera);
  for (std::size_t i = 0; i < kept.size(); ++i) {
    EXPECT_EQ(kept[i].id, shared[i].id);
    EXPECT_LT((kept[i].map_from_camera.t - compose(camera_from_robot, shared[i].map_from_camera).t).norm(), 1e-9)
        << "nobody moves them";
  }
}

TEST(SharedKeyframes, strangers_and_nonsense_are_left_out) {
  StarryCorridor corridor(2);
  Driven beta("beta");
  EXPECT_EQ(beta.client.keep_shared(beta.place, 0, keyframes_of_alpha(), {}), 0) << "it has no map yet";
  beta.to(corridor, 0.0, 0.2);
  const SharedKeyframe& good = keyframes_of_alpha().front();
  const auto taken = [&](SharedKeyframe one) { return beta.client.keep_shared(beta.place, 0, {std::move(one)}, {}); };
  EXPECT_EQ(beta.client.keep_shared(beta.place, 3, {good}, {}), 0) << "no such session";
  SharedKeyframe bad = good;
  bad.id.session = *beta.client.run(beta.place);
  EXPECT_EQ(taken(bad), 0) << "its own";
  bad = good;
  bad.features.reset();
  EXPECT_EQ(taken(bad), 0) << "a light one that it does not know";
  bad = good;
  bad.map_from_camera.t.x() = std::nan("");
  EXPECT_EQ(taken(bad), 0);
  bad = good;
  bad.map_from_camera.t.x() = 1e9;
  EXPECT_EQ(taken(bad), 0);
  bad = good;
  bad.map_from_camera.q.coeffs() *= 2.0;
  EXPECT_EQ(taken(bad), 0);
  for (const double scale : {0.0, -1.0, 1e9, std::nan("")}) {
    bad = good;
    bad.scale = scale;
    EXPECT_EQ(taken(bad), 0);
  }
  bad = good;
  bad.features->points.resize(20000);
  bad.features->descriptors.resize(20000);
  EXPECT_EQ(taken(bad), 0);
  EXPECT_TRUE(beta.client.shared_keyframes().empty());
  bad = good;
  bad.landmarks.front().point_in_map.x() = std::nan("");
  bad.landmarks.back().id.session = *beta.client.run(beta.place);
  EXPECT_EQ(taken(bad), 1);
  EXPECT_EQ(beta.client.shared_keyframes().front().landmarks, good.landmarks.size() - 2);
  beta.client.keep_shared(beta.place, 0, {}, {bad.id});
  EXPECT_TRUE(beta.client.shared_keyframes().empty());
}

TEST(SharedKeyframes, are_bounded_and_the_farthest_go) {
  StarryCorridor corridor(2);
  ClientOptions options;
  options.memory.shared_keyframes = 3;
  Driven beta("beta", options);
  beta.to(corridor, 0.0, 0.2);
  beta.client.keep_shared(beta.place, 0, keyframes_of_alpha(), {});
  const auto kept = beta.client.shared_keyframes();
  ASSERT_EQ(kept.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) EXPECT_EQ(kept[i].id, keyframes_of_alpha()[i].id) << "nearest to where it begins";
  EXPECT_EQ(beta.client.dropped_shared(), keyframes_of_alpha().size() - 3);
}

// A server that is wrong, or lies: the keyframes are two metres from where they should be, which no path explains.
TEST(SharedKeyframes, that_are_where_they_cannot_be_move_nothing) {
  for (const double off_m : {2.0, -2.0}) {
    StarryCorridor corridor(2);
    Driven beta("beta");
    beta.to(corridor, 0.0, 0.2);
    auto wrong = keyframes_of_alpha();
    for (SharedKeyframe& one : wrong) {
      one.map_from_camera.t.x() += off_m;
      for (DescribedLandmark& landmark : one.landmarks) landmark.point_in_map.x() += off_m;
    }
    EXPECT_EQ(beta.client.keep_shared(beta.place, 0, wrong, {}), static_cast<int>(wrong.size()));
    beta.to(corridor, 0.2, 7.0);
    beta.client.finish();
    EXPECT_TRUE(beta.client.loops().empty());
    EXPECT_LT(test::error_of(beta.client, beta.truth), 0.03);
  }
}

}  // namespace
}  // namespace mapweave::visual
