#include "tracking/frame_pose.h"

#include <gmock/gmock.h>
#include <cmath>
#include <random>

namespace mapweave::visual {
namespace {

// A thing of 0.3 m that is near, and a room around it; the camera has turned in the room, but not before the thing.
class ThingInARoom : public testing::Test {
 protected:
  ThingInARoom() {
    map.camera = {320, 240, 260.0, 260.0, 159.5, 119.5};
    map.add(Keyframe());
    in_room.rotation = Eigen::AngleAxisd(0.015, Eigen::Vector3d::UnitY()).toRotationMatrix();
  }
  double uniform(double from, double to) { return std::uniform_real_distribution<double>(from, to)(random); }
  void see(const Eigen::Vector3d& point, const View& view) {
    ClientLandmark landmark;
    landmark.point = point;
    const int id = map.add(std::move(landmark));
    const Eigen::Vector2d pixel = map.camera.project(view * point);
    map.see(id, {0, map.sighting_of({id, map.camera.project(point), Eigen::Vector2d::Zero()}, 0.5)});
    attempt.found.push_back({id, pixel, Eigen::Vector2d::Zero()});
  }
  void see_thing(int points) {
    for (int i = 0; i < points; ++i) see({uniform(-0.15, 0.15), uniform(-0.1, 0.2), uniform(0.6, 0.7)}, View());
  }
  void see_room(int points) {
    for (int i = 0; i < points; ++i) {
      const double depth = uniform(1.5, 4.0);
      see({depth * uniform(-0.5, 0.5), depth * uniform(-0.4, 0.4), depth}, in_room);
    }
  }
  // What fits is what lies still before the camera.
  bool is_led() {
    for (const Match& match : attempt.found) {
      const bool fits = (map.camera.project(map.landmark(match.landmark).point) - match.pixel).norm() < 1.0;
      attempt.pose.fits.push_back(fits);
      attempt.pose.count += fits;
    }
    return is_led_by_a_thing(map, attempt, options);
  }

  std::mt19937_64 random{5};
  LandmarkMap map;
  View in_room;
  TrackingOptions options;
  Attempt attempt;
};

TEST_F(ThingInARoom, leads_a_camera_whose_picture_it_fills) {
  see_thing(36);
  see_room(12);
  EXPECT_TRUE(is_led());
}

TEST_F(ThingInARoom, leads_nobody_who_sees_more_of_the_room) {
  see_thing(36);
  in_room = View();
  see_room(40);
  for (Match& match : attempt.found)
    if (map.landmark(match.landmark).point.z() < 1.0) match.pixel.x() += 4.0;
  EXPECT_FALSE(is_led()) << "the thing moved, not the camera";
}

TEST_F(ThingInARoom, leads_nobody_where_nothing_else_agrees) {
  see_thing(36);
  for (int i = 0; i < 12; ++i) {
    View wrong;
    wrong.rotation = Eigen::AngleAxisd(0.02 * (i % 2 == 0 ? 1 : -1),
                                       i % 3 == 0 ? Eigen::Vector3d::UnitX().eval() : Eigen::Vector3d::UnitY().eval())
                         .toRotationMatrix();
    see({uniform(-1.0, 1.0), uniform(-0.8, 0.8), uniform(2.0, 4.0)}, wrong);
  }
  EXPECT_FALSE(is_led());
}

TEST_F(ThingInARoom, leads_nobody_while_few_landmarks_speak_against_it) {
  see_thing(36);
  see_room(5);
  EXPECT_FALSE(is_led());
}

}  // namespace
}  // namespace mapweave::visual
