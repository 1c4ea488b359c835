#pragma once
#include <gmock/gmock.h>
#include <mapweave/core/geometry.h>

namespace mapweave::test {

MATCHER_P3(IsNear, expected, metres, radians,
           "is within " + ::testing::PrintToString(metres) + " m and " + ::testing::PrintToString(radians) +
               " rad of (" + ::testing::PrintToString(expected.x) + ", " + ::testing::PrintToString(expected.y) + ", " +
               ::testing::PrintToString(expected.phi) + ")") {
  const double distance = std::hypot(arg.x - expected.x, arg.y - expected.y);
  const double turn = std::abs(wrap_angle(arg.phi - expected.phi));
  *result_listener << "which is " << distance << " m and " << turn << " rad away: (" << arg.x << ", " << arg.y << ", "
                   << arg.phi << ")";
  return distance <= metres && turn <= radians;
}

}  // namespace mapweave::test
