#pragma once
// The pictures that scenes hang on their surfaces. Pure functions of their arguments.

#include <mapweave/simulation/scene.h>

namespace mapweave::simulation {

enum class Pattern { blank, wall, furniture };

void paint_wall(Canvas&, const Canvas::Area&, Pattern, int contrast, RandomNumbers);
Texture floor_texture(double period_m, int contrast, RandomNumbers);
Texture ceiling_texture(int contrast, RandomNumbers);
Texture detail_texture(RandomNumbers);                             // about a middle of 128
Texture poster_texture(RandomNumbers);                             // 256 x 256 over the whole poster
Texture body_texture(RandomNumbers);                               // 256 x 256: once around, from top to bottom
std::pair<Colour, Colour> colours(bool is_vivid, RandomNumbers&);  // dark and light

constexpr int kFloorTexels = 2048, kCeilingTexels = 1024;
constexpr double kFloorPeriod = 10.24, kCeilingPeriod = 10.24;  // metres

}  // namespace mapweave::simulation
