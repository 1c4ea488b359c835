#include "looking.h"

#include <mapweave/core/hash.h>
#include <mapweave/simulation/ray_caster.h>
#include <mapweave/simulation/renderer.h>

#include <gtest/gtest.h>

#include <cmath>

namespace mapweave::simulation {
namespace {

using Eigen::Vector3d;
using test::looking;

const Scene& apartment() {
  static WorkerPool here(1);
  static const Scene scene(make_apartment_plan({}, 7), {}, 7, here);
  return scene;
}
FloorPlan apartment_plan() { return make_apartment_plan({}, 7); }

RenderedView rendered(const Scene& scene, const CameraModel& camera, const Pose3& world_from_camera,
                      Channels channels = Channels::none, const std::vector<Surface>& moving = {}) {
  RenderedView view;
  render(scene, moving, camera, world_from_camera, channels, view);
  return view;
}

Vector3d point_of(const RenderedView& view, const CameraModel& camera, const Pose3& world_from_camera, int row,
                  int column) {
  const Vector3d ray(camera.x(row)[column], camera.y(row)[column], 1.0);
  return transformed(ray * view.depth(row, column), world_from_camera);
}

TEST(Render, shows_a_wall_at_its_distance_whatever_the_camera_is_tipped_by) {
  WorkerPool here(1);
  CorridorOptions corridor;
  corridor.doors = corridor.clutter = 0;
  LookOptions look;
  look.posters_per_10_m = 0.0;  // they hang 4 mm before the wall
  const Scene scene(make_corridor_plan(corridor, 1), look, 1, here);
  const CameraModel camera(test::small_camera());
  const RenderedView level = rendered(scene, camera, looking(16.0, 1.0, 1.2, 0.0));
  EXPECT_NEAR(level.depth(60, 80), 4.0, 1e-4);
  EXPECT_NEAR(level.depth(60, 70), 4.0, 1e-4) << "depth is along the axis, not along the ray";
  for (const double pitch : {-0.2, 0.1, 0.3}) {
    const Pose3 pose = looking(16.0, 1.0, 1.2, 0.2, pitch, 0.15);
    const RenderedView view = rendered(scene, camera, pose);
    int on_wall = 0;
    for (int row = 0; row < 120; row += 5) {
      for (int column = 0; column < 160; column += 5) {
        const Vector3d p = point_of(view, camera, pose, row, column);
        const double away = std::min(
            {std::abs(p.x() - 20.0), std::abs(p.y()), std::abs(p.y() - 2.0), std::abs(p.z()), std::abs(p.z() - 2.6)});
        EXPECT_LT(away, 1e-4);
        on_wall += std::abs(p.x() - 20.0) < 1e-4;
      }
    }
    EXPECT_GT(on_wall, 50);
  }
}

TEST(Render, agrees_with_the_ray_caster_about_every_wall_and_piece_of_furniture) {
  const FloorPlan plan = apartment_plan();
  const RayCaster caster(plan.walls);
  CameraIntrinsics intrinsics = test::small_camera();
  intrinsics.cy = 60.0;  // so that a row of pixels looks level
  const CameraModel camera(intrinsics);
  int agreeing = 0, looked = 0;
  for (const Room& room : plan.rooms) {
    for (int i = 0; i < 8; ++i) {
      const double yaw = 0.1 + i * M_PI / 4.0;
      const Point2 eye = room.inside.centre();
      const RenderedView view = rendered(apartment(), camera, looking(eye.x, eye.y, 0.3, yaw));
      for (int column = 0; column < 160; ++column) {
        const double x = camera.x(60)[column], length = std::hypot(1.0, x), angle = yaw - std::atan(x);
        const double distance = caster.distance(eye, std::cos(angle), std::sin(angle), 100.0);
        ++looked;
        agreeing +=
            std::abs(view.depth(60, column) * length - distance) < 0.005;  // but for pictures, which hang before walls
      }
    }
  }
  EXPECT_GT(agreeing, 0.998 * looked);  // the two may see different sides of a corner
}

TEST(Render, shows_a_texel_where_the_truth_says_it_is_in_a_second_view) {
  const CameraModel camera(test::small_camera());
  const Pose3 first_pose = looking(9.0, 6.5, 0.6, 0.1), second_pose = looking(9.3, 6.4, 0.7, 0.2, 0.05, -0.03);
  const RenderedView first = rendered(apartment(), camera, first_pose, Channels::grey),
                     second = rendered(apartment(), camera, second_pose, Channels::grey);
  int same_surface = 0, seen = 0;
  double difference = 0.0;
  for (int row = 2; row < 118; ++row) {
    for (int column = 2; column < 158; ++column) {
      const Vector3d p = point_of(first, camera, first_pose, row, column);
      const auto pixel = camera.project(transformed(p, inverse(second_pose)));
      if (!pixel || pixel->x() < 1.0 || pixel->y() < 1.0 || pixel->x() > 158.0 || pixel->y() > 118.0) continue;
      const int u = static_cast<int>(std::lround(pixel->x())), v = static_cast<int>(std::lround(pixel->y()));
      const auto number = [](const RenderedView& view, std::size_t at) {
        return view.surfaces[static_cast<std::size_t>(view.surface[at])].number;
      };
      ++seen;
      if (number(first, first.at(row, column)) != number(second, second.at(v, u))) continue;  // hidden, or at a rim
      ++same_surface;
      const Vector3d seen_point = transformed(p, inverse(second_pose)), ray = seen_point / seen_point.z();
      const RenderedView::Shown& surface = second.surfaces[static_cast<std::size_t>(second.surface[second.at(v, u)])];
      ASSERT_NEAR(surface.inverse_depth.cast<double>().dot(ray) * seen_point.z(), 1.0, 1e-4)
          << "the same point of the same surface";
      difference += std::abs(first.values[first.at(row, column)] - second.values[second.at(v, u)]);
    }
  }
  EXPECT_GT(seen, 10000);
  EXPECT_GT(same_surface, 0.9 * seen);
  EXPECT_LT(difference / same_surface, 8.0) << "grey levels";
}

TEST(Render, bends_the_picture_as_the_distortion_says) {
  CameraIntrinsics intrinsics = test::small_camera();
  const CameraModel straight(intrinsics);
  intrinsics.distortion = test::kinect_distortion();
  const CameraModel bent(intrinsics);
  const Pose3 pose = looking(9.0, 6.5, 0.6, 0.1);
  const RenderedView view = rendered(apartment(), straight, pose), bent_view = rendered(apartment(), bent, pose);
  int same = 0, seen = 0;
  double moved = 0.0;
  for (int row = 0; row < 120; ++row) {
    for (int column = 0; column < 160; ++column) {
      const auto pixel = straight.project({bent.x(row)[column], bent.y(row)[column], 1.0});
      if (!pixel) continue;
      moved = std::max(moved, std::hypot(pixel->x() - column, pixel->y() - row));
      ++seen;
      const double other =
          view.depth(static_cast<int>(std::lround(pixel->y())), static_cast<int>(std::lround(pixel->x())));
      same += std::abs(bent_view.depth(row, column) - other) < 0.05 * other;
    }
  }
  EXPECT_GT(moved, 1.0);
  EXPECT_GT(same, 0.97 * seen);
}

TEST(Render, hides_what_is_behind_a_body_and_nothing_else) {
  const CameraModel camera(test::small_camera());
  const Pose3 pose = looking(9.0, 6.5, 0.6, 0.0);
  const RenderedView empty = rendered(apartment(), camera, pose, Channels::grey);
  const RenderedView view =
      rendered(apartment(), camera, pose, Channels::grey, apartment().surfaces_of({{10.0, 6.5, 0.3}, 0.2, 1.7, 1}));
  EXPECT_NEAR(view.depth(60, 80), 0.8, 0.03);
  int covered = 0;
  for (int row = 0; row < 120; ++row) {
    for (int column = 0; column < 160; ++column) covered += view.depth(row, column) != empty.depth(row, column);
  }
  EXPECT_NEAR(covered, 131.2 * 0.4 / 0.98 * 120, 1200) << "a strip as wide as the body";
}

TEST(Render, averages_what_is_smaller_than_a_pixel) {
  const CameraModel camera(test::small_camera());
  const Pose3 pose = looking(1.0, 6.5, 0.6, 0.0);  // along the corridor
  double sum = 0.0;
  int count = 0;
  const RenderedView still = rendered(apartment(), camera, pose, Channels::grey);
  const RenderedView moved = rendered(apartment(), camera, looking(1.003, 6.5, 0.6, 0.0), Channels::grey);
  for (int row = 0; row < 120; ++row) {
    for (int column = 0; column < 160; ++column) {
      if (still.depth(row, column) < 4.0) continue;
      sum += std::abs(still.values[still.at(row, column)] - moved.values[moved.at(row, column)]);
      ++count;
    }
  }
  ASSERT_GT(count, 1000);
  EXPECT_LT(sum / count, 1.5) << "3 mm change far pixels little; without levels they would flicker";
}

TEST(Render, shows_colours_whose_luma_is_the_grey_picture) {
  const CameraModel camera(test::small_camera());
  const Pose3 pose = looking(9.0, 6.5, 0.6, 2.0);
  const RenderedView grey = rendered(apartment(), camera, pose, Channels::grey);
  const RenderedView colour = rendered(apartment(), camera, pose, Channels::colour);
  double chroma = 0.0;
  for (std::size_t i = 0; i < 100 * 192; ++i) {
    if (i % 192 >= 160) continue;
    const float red = colour.values[3 * i], green = colour.values[3 * i + 1], blue = colour.values[3 * i + 2];
    EXPECT_NEAR(0.299f * red + 0.587f * green + 0.114f * blue, grey.values[i], 0.01);
    chroma = std::max(chroma, std::abs(static_cast<double>(red - blue)));
  }
  EXPECT_GT(chroma, 10.0);
}

TEST(Scene, is_the_same_whatever_the_threads) {
  const auto hash = [](int threads) {
    WorkerPool pool(threads);
    const Scene scene(make_corridor_plan({}, 3), {}, 3, pool);
    const RenderedView view =
        rendered(scene, CameraModel(test::small_camera()), looking(5.0, 1.0, 0.5, 0.3), Channels::colour);
    Hasher hasher;
    for (const float value : view.values) hasher.add(static_cast<double>(value));
    return to_hex(hasher.finish());
  };
  EXPECT_EQ(hash(1), hash(2));
}

TEST(Scene, repeats_rooms_down_to_the_last_pixel) {
  WorkerPool here(1);
  RoomRowOptions rooms;
  const FloorPlan plan = make_repeated_rooms_plan(rooms, 5);
  const Scene scene(plan, {}, 5, here);
  const CameraModel camera(test::small_camera());
  const Point2 eye = plan.rooms[1].inside.centre();
  // Into the room's far corner, where no door shows what lies beyond.
  const RenderedView one = rendered(scene, camera, looking(eye.x, eye.y, 0.6, M_PI_2), Channels::grey);
  const RenderedView other =
      rendered(scene, camera, looking(eye.x + 2.0 * rooms.room_width_m, eye.y, 0.6, M_PI_2), Channels::grey);
  double worst = 0.0;
  for (int row = 0; row < 120; ++row) {
    for (int column = 0; column < 160; ++column)
      worst = std::max(
          worst, std::abs(static_cast<double>(one.values[one.at(row, column)] - other.values[other.at(row, column)])));
  }
  EXPECT_LT(worst, 2.0);
}

}  // namespace
}  // namespace mapweave::simulation
