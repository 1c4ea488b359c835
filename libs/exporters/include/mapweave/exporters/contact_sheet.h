#pragma once
// A few pictures of a camera side by side, with what was followed through them.

#include <mapweave/core/stamp.h>

#include <cstdint>
#include <string>
#include <vector>

namespace mapweave::exporters {

struct SheetTrack {
  std::vector<std::pair<float, float>>
      pixels;  // where it was in the frames before and is in this one, the oldest first
  float depth_m = 0.0F;
};

struct SheetFrame {
  int width = 0, height = 0;
  std::vector<std::uint8_t> grey;  // row by row
  std::string caption;
  std::vector<SheetTrack> tracks;
};

struct ContactSheetOptions {
  int columns = 4;
  int picture_width_px = 360;
  std::string title;
};

// As a sheet shows it: shrunk to this width where it is wider. Contract: it has its pixels.
SheetFrame shrunk(SheetFrame, int width_px = ContactSheetOptions().picture_width_px);

// PNG. Tracks from near (orange) to far (blue). Contract: there are frames, each with its pixels.
std::string contact_sheet_png(const std::vector<SheetFrame>&, const ContactSheetOptions& = {});

}  // namespace mapweave::exporters
