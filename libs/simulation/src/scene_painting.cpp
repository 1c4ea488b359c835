#include "scene_painting.h"

#include <algorithm>
#include <cmath>

namespace mapweave::simulation {
namespace {

constexpr double kScales[] = {0.9, 0.45, 0.22, 0.11, 0.055, 0.028};  // metres: what is found from 15 m to 0.5 m

}  // namespace

void paint_wall(Canvas& canvas, const Canvas::Area& area, Pattern pattern, int contrast, RandomNumbers numbers) {
  canvas.fill(area, numbers.integer(75, 185));
  canvas.add_gradient(area, numbers.integer(-8, 8), numbers.integer(-8, 8));
  if (pattern == Pattern::blank) {
    canvas.add_grain(area, 1.0, numbers);
    return;
  }
  const double density = numbers.uniform(0.15, 0.55);
  for (const double scale : kScales) {
    if (pattern == Pattern::furniture && scale > 0.6) continue;
    const double share = density * (scale > 0.3 ? 0.6 : scale > 0.05 ? 0.45 : 0.25) * numbers.uniform(0.5, 1.2);
    canvas.add_shapes(area, scale, share, scale > 0.3 ? contrast * 2 / 3 : contrast, numbers);
  }
  if (pattern == Pattern::furniture) canvas.add_lines(area, numbers.uniform(0.3, 0.6), 0.012, -60, numbers.chance(0.5));
  canvas.add_grain(area, 3.0, numbers);
}

Texture floor_texture(double period_m, int contrast, RandomNumbers numbers) {
  Canvas canvas(kFloorTexels, kFloorTexels, period_m / kFloorTexels);
  const Canvas::Area all{0.0, 0.0, period_m, period_m};
  canvas.fill(all, 120);
  for (const double scale : kScales) canvas.add_shapes(all, scale, scale > 0.3 ? 0.2 : 0.12, contrast * 2 / 3, numbers);
  canvas.add_lines(all, period_m / 16.0, 0.008, -25, true);
  canvas.add_lines(all, period_m / 16.0, 0.008, -25, false);
  canvas.add_grain(all, 5.0, numbers);
  return Texture(kFloorTexels, kFloorTexels, canvas.take());
}

Texture ceiling_texture(int contrast, RandomNumbers numbers) {
  Canvas canvas(kCeilingTexels, kCeilingTexels, kCeilingPeriod / kCeilingTexels);
  const Canvas::Area all{0.0, 0.0, kCeilingPeriod, kCeilingPeriod};
  canvas.fill(all, 150);
  canvas.add_shapes(all, 0.5, 0.06, contrast, numbers);  // lamps, stains, vents
  canvas.add_shapes(all, 0.15, 0.03, contrast, numbers);
  canvas.add_lines(all, kCeilingPeriod / 16.0, 0.02, -20, true);
  canvas.add_lines(all, kCeilingPeriod / 16.0, 0.02, -20, false);
  canvas.add_grain(all, 2.0, numbers);
  return Texture(kCeilingTexels, kCeilingTexels, canvas.take());
}

Texture detail_texture(RandomNumbers numbers) {
  constexpr int kSize = 1024;
  Canvas canvas(kSize, kSize, Scene::kDetailTexel);
  const Canvas::Area all{0.0, 0.0, kSize * Scene::kDetailTexel, kSize * Scene::kDetailTexel};
  for (const double scale : {0.02, 0.01, 0.005}) canvas.add_shapes(all, scale, 0.2, 18, numbers);
  canvas.add_grain(all, 3.0, numbers);
  return Texture(kSize, kSize, canvas.take());
}

Texture poster_texture(RandomNumbers numbers) {
  constexpr int kSize = 256;
  Canvas canvas(kSize, kSize, 1.0 / kSize);
  const Canvas::Area all{0.0, 0.0, 1.0, 1.0}, frame{0.03, 0.03, 0.94, 0.94};
  canvas.fill(all, numbers.chance(0.5) ? 30 : 230);
  canvas.fill(frame, numbers.integer(80, 180));
  for (const double scale : {0.4, 0.2, 0.1, 0.05}) canvas.add_shapes(frame, scale, 0.7, 90, numbers);
  const double text_top = numbers.uniform(0.5, 0.75);
  for (double y = text_top; y < 0.9; y += 0.04) {  // lines of words
    for (double x = 0.08; x < 0.88;) {
      const double width = std::min(numbers.uniform(0.02, 0.1), 0.92 - x);
      canvas.fill({x, y, width, 0.018}, numbers.chance(0.8) ? 20 : 240);
      x += width + 0.015;
    }
  }
  canvas.add_grain(all, 3.0, numbers);
  return Texture(kSize, kSize, canvas.take());
}

Texture body_texture(RandomNumbers numbers) {
  constexpr int kSize = 256;
  Canvas canvas(kSize, kSize, 1.0 / kSize);
  const Canvas::Area all{0.0, 0.0, 1.0, 1.0};
  canvas.fill(all, 120);
  canvas.fill({0.0, 0.15, 1.0, 0.4}, numbers.integer(60, 200));
  canvas.fill({0.0, 0.55, 1.0, 0.45}, numbers.integer(40, 120));
  for (const double scale : {0.3, 0.12, 0.05, 0.025}) canvas.add_shapes(all, scale, 0.4, 50, numbers);
  canvas.add_grain(all, 3.0, numbers);
  return Texture(kSize, kSize, canvas.take());
}

std::pair<Colour, Colour> colours(bool is_vivid, RandomNumbers& numbers) {
  const float spread = is_vivid ? 0.35f : 0.07f;
  const auto around = [&](float middle) {
    const auto channel = [&] {
      return std::clamp(middle + spread * static_cast<float>(numbers.uniform(-1.0, 1.0)), 0.0f, 1.0f);
    };
    const float red = channel(), green = channel(), blue = channel();
    return Colour{red, green, blue};
  };
  const Colour dark = around(is_vivid ? 0.2f : 0.12f), light = around(is_vivid ? 0.85f : 0.95f);
  return {dark, light};
}

}  // namespace mapweave::simulation
