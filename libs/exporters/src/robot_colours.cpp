#include <mapweave/exporters/robot_colours.h>

namespace mapweave::exporters {

RobotColour robot_colour(std::size_t place) {
  static constexpr RobotColour kColours[] = {{0, 114, 178},  {213, 94, 0},  {0, 158, 115}, {204, 121, 167},
                                             {86, 180, 233}, {230, 159, 0}, {136, 34, 85}, {153, 153, 51}};
  constexpr std::size_t kCount = sizeof kColours / sizeof *kColours;
  const auto darker = [](std::uint8_t channel) { return static_cast<std::uint8_t>(channel * 3 / 5); };
  const RobotColour colour = kColours[place % kCount];
  if (place / kCount % 2 == 1) return {darker(colour.red), darker(colour.green), darker(colour.blue)};
  return colour;
}

}  // namespace mapweave::exporters
