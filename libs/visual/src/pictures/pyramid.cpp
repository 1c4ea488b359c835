#include "pyramid.h"

namespace mapweave::visual {

Pyramid make_pyramid(GreyImage picture) {
  Pyramid result;
  result.levels.push_back(std::move(picture));
  while (static_cast<int>(result.levels.size()) < kLevels) {
    const GreyImage& fine = result.levels.back();
    GreyImage coarse(fine.width / 2, fine.height / 2);
    for (int y = 0; y < coarse.height; ++y) {
      const std::uint8_t* p = fine.row(2 * y);
      const std::uint8_t* q = fine.row(2 * y + 1);
      std::uint8_t* out = coarse.row(y);
      for (int x = 0; x < coarse.width; ++x)
        out[x] = static_cast<std::uint8_t>((p[2 * x] + p[2 * x + 1] + q[2 * x] + q[2 * x + 1] + 2) >> 2);
    }
    result.levels.push_back(std::move(coarse));
  }
  return result;
}

}  // namespace mapweave::visual
