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
  // Root mean square, in the frame of the first camera, which stood where the world begins.
  double error_m() const {
    double square = 0.0;
    const auto frames = client.trajectory();
    for (const PlacedFrame& frame : frames)
      square += (frame.map_from_camera.t -
                 truth[static_cast<std::size_t>(std::lround((frame.stamp.seconds() - 100.0) * 15.0))].t)
                    .squaredNorm();
    return frames.size() == truth.size() ? std::sqrt(square / static_cast<double>(truth.size()))
                                         : std::numeric_limits<double>::infinity();
  }
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
  EXPECT_LT(beta.error_m(), 0.03);
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
    EXPECT_LT(beta.error_m(), 0.03);
  }
}

// Of a map whose first camera stood at `world_from_theirs`, to that of a client whose first one stood at
// `world_from_own`.
std::vector<SharedKeyframe> moved(std::vector<SharedKeyframe> shared, const Pose3& world_from_theirs,
                                  const Pose3& world_from_own) {
  const Pose3 own_from_theirs =
      compose(compose(test::kRobotFromCamera, compose(inverse(world_from_own), world_from_theirs)),
              inverse(test::kRobotFromCamera));
  for (SharedKeyframe& one : shared) {
    one.map_from_camera = compose(own_from_theirs, one.map_from_camera);
    for (DescribedLandmark& landmark : one.landmarks)
      landmark = matching::transformed(landmark, {own_from_theirs, 1.0});
  }
  return shared;
}

// Beta sees where the corridor begins; then its lens is covered until it is where alpha alone has been. No server.
TEST(SharedKeyframes, find_a_lost_client_again) {
  for (const bool keeps : {false, true}) {
    StarryCorridor first(1), second(2);
    Driven alpha("alpha"), beta("beta");
    alpha.to(first, 0.0, 16.0);
    int frame = 0;
    const auto add = [&](double z, bool is_dark) {
      visual::FeatureFrame seen = second.frame(test::at(frame++), at_m(z), 0.2, 0.002);
      if (is_dark) {
        seen.features = {};
        seen.inverse_depths.clear();
      }
      seen.odometry_from_camera = at_m(z);
      beta.truth.push_back(at_m(z));
      return beta.client.add(seen);
    };
    double z = 0.0;
    for (; z < 2.0; z += 0.05) add(z, false);
    if (keeps) {
      const auto shared = shared_of(alpha.client.maps(alpha.place).front());
      ASSERT_EQ(beta.client.keep_shared(beta.place, 0, shared, {}), static_cast<int>(shared.size()));
    }
    for (; z < 10.0; z += 0.05) add(z, true);
    Tracked last;
    for (; z < 11.5; z += 0.05) last = add(z, false);
    EXPECT_EQ(beta.client.found_by_shared(), keeps ? 1U : 0U);
    EXPECT_EQ(last.state == TrackState::tracked && last.session == 0, keeps);
    if (keeps) {
      EXPECT_LT((last.map_from_camera.t - at_m(z - 0.05).t).norm(), 0.1);
    }
  }
}

// A client that is lost begins another map, and its server shares the same keyframes for that one. Back in the first
// map it does not have them any longer, which its server cannot know.
// Beta, lost in the dark, has begun a second map.
void drive_twice(Driven& beta) {
  StarryCorridor corridor(2);
  int frame = 0;
  for (const auto& [from_m, to_m, is_dark] : {std::tuple(0.0, 3.0, false), {3.0, 14.0, true}, {14.0, 20.0, false}})
    for (double z = from_m; z < to_m; z += 0.05) {
      visual::FeatureFrame seen = corridor.frame(test::at(frame++), at_m(z), 0.2, 0.002);
      if (is_dark) {
        seen.features = {};
        seen.inverse_depths.clear();
      }
      beta.client.add(seen);
    }
}

TEST(SharedKeyframes, are_missed_by_a_session_that_lost_them_to_another) {
  Driven beta("beta");
  drive_twice(beta);
  ASSERT_EQ(beta.client.sessions().size(), 2U);
  std::vector<SharedKeyframe> shared = keyframes_of_alpha();
  shared.resize(4);
  ASSERT_EQ(beta.client.keep_shared(beta.place, 1, shared, {}), 4);
  EXPECT_EQ(beta.client.view(beta.place)->missed, 0U) << "it has them";
  ASSERT_EQ(beta.client.keep_shared(beta.place, 0, shared, {}), 4);
  const std::uint32_t missed = beta.client.view(beta.place)->missed;
  EXPECT_GT(missed, 0U);
  ASSERT_EQ(beta.client.keep_shared(beta.place, 1, shared, {}), 4);
  EXPECT_EQ(beta.client.view(beta.place)->missed, missed) << "it has them again";
}

TEST(SharedKeyframes, leave_room_for_those_of_the_map_that_they_were_sent_for) {
  ClientOptions options;
  options.memory.shared_keyframes = 4;
  Driven beta("beta", options);
  drive_twice(beta);
  ASSERT_EQ(beta.client.sessions().size(), 2U);
  const std::vector<SharedKeyframe> shared = keyframes_of_alpha();
  ASSERT_GE(shared.size(), 6U);
  const auto begin = shared.begin();
  beta.client.keep_shared(beta.place, 1, {begin, begin + 3}, {});
  EXPECT_EQ(beta.client.view(beta.place)->missed, 0U);
  beta.client.keep_shared(beta.place, 0, {begin + 3, begin + 6}, {});
  std::map<int, int> of_session;
  for (const PlacedShared& one : beta.client.shared_keyframes()) ++of_session[one.session];
  EXPECT_EQ(of_session, (std::map<int, int>{{0, 3}, {1, 1}}));
  EXPECT_GT(beta.client.view(beta.place)->missed, 0U);
}

// CORB-SLAM, figure 5: beta, whose camera is worse, drives around a corridor that closes on itself, and comes to where
// alpha was, before it sees anything of its own again. No server.
TEST(SharedKeyframes, close_a_clients_loop_and_stay_where_they_are) {
  constexpr double kStep_m = 0.06, kAround_m = 2.0 * M_PI * StarryCorridor::kRadius_m;
  const auto drive = [&](StarryCorridor& corridor, Driven& driven, double from_m, double to_m, double noise) {
    for (double z = from_m; z < to_m; z += kStep_m) {
      driven.truth.push_back(StarryCorridor::along_ring(z));
      driven.client.add(corridor.frame(test::at(static_cast<int>(driven.truth.size()) - 1), driven.truth.back(), noise,
                                       0.01 * noise, 0.01 * noise));
    }
  };
  StarryCorridor good(1, true);
  ClientOptions seeing;
  seeing.window.learn_depth_offset = false;
  Driven alpha("alpha", seeing);
  drive(good, alpha, -9.0, 3.0, 0.02);
  std::map<bool, double> error_m;
  for (const bool keeps : {false, true}) {
    StarryCorridor poor(2, true);
    Driven beta("beta", seeing);
    drive(poor, beta, 2.0, 2.1, 1.0);
    const auto shared =
        moved(shared_of(alpha.client.maps(alpha.place).front()), alpha.truth.front(), beta.truth.front());
    if (keeps) {
      ASSERT_EQ(beta.client.keep_shared(beta.place, 0, shared, {}), static_cast<int>(shared.size()));
    }
    const auto before = beta.client.shared_keyframes();
    drive(poor, beta, 2.1, kAround_m - 2.0, 1.0);
    beta.client.finish();
    error_m[keeps] = test::error_of(beta.client, beta.truth);
    std::size_t on_shared = 0;
    for (const ClosedLoop& loop : beta.client.loops()) on_shared += loop.on_shared.has_value();
    std::printf("error %.3f m, %zu loops on %zu keyframes of others\n", error_m[keeps], on_shared, before.size());
    EXPECT_EQ(on_shared > 0, keeps);
    EXPECT_EQ(beta.client.loops().size(), on_shared);
    const auto after = beta.client.shared_keyframes();
    ASSERT_EQ(after.size(), before.size());
    for (std::size_t i = 0; i < after.size(); ++i)
      EXPECT_LT((after[i].map_from_camera.t - before[i].map_from_camera.t).norm(), 1e-9);
  }
  EXPECT_LT(error_m[true], 0.8 * error_m[false]);
}

}  // namespace
}  // namespace mapweave::visual
