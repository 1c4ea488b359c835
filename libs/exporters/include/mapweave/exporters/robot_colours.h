#pragma once
// One colour for each robot, the same in all pictures, clouds and messages.

#include <cstddef>
#include <cstdint>

namespace mapweave::exporters {

struct RobotColour {
  std::uint8_t red, green, blue;
};

// Of the robot at this place among the RobotIds present. 8 that people with any colour vision can distinguish on white
// (Okabe and Ito; Tol), 8 darker ones, and over again.
RobotColour robot_colour(std::size_t place);

}  // namespace mapweave::exporters
