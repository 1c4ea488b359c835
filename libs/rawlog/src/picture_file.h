#pragma once
// Pictures in files, looked at before anybody decodes them: decoders fill what a truncated picture lacks with grey, and
// say nothing.

#include <mrpt/math/CMatrixDynamic.h>

#include <cstdint>
#include <filesystem>
#include <optional>
#include <string_view>

namespace mapweave::rawlog {

struct PictureFile {
  std::uint32_t width = 0, height = 0;
  int bits = 0, channels = 0;  // of one channel; of the file (a palette counts as one)
};

// Reads the head and the end of the file. Throws Error: kMissing; kCorrupt for a file that is no PNG or JPEG, or does
// not reach its end mark.
PictureFile look_at_picture(const std::filesystem::path& file);

bool is_png_or_jpeg(const std::filesystem::path& file);  // false for what cannot be opened
// Of a JPEG's bytes; nullopt where no size stands in them.
std::optional<PictureFile> jpeg_size(std::string_view bytes);

// A depth picture of 16 bits and one channel, as numbers. Throws Error: what look_at_picture() throws, kBadInput for a
// picture of another kind, kCorrupt for one that cannot be decoded.
mrpt::math::CMatrix_u16 read_depth_picture(const std::filesystem::path& file);

}  // namespace mapweave::rawlog
