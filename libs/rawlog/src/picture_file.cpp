#include "picture_file.h"

#include <mapweave/core/error.h>

#include <algorithm>
#include <array>
#include <cstring>
#include <fstream>
#include <opencv2/core/mat.hpp>
#include <opencv2/imgcodecs.hpp>
#include <optional>
#include <string>
#include <string_view>

namespace mapweave::rawlog {
namespace {

constexpr const char* kCopyAgain = "copy the pictures again, or take the frame out of the recording";
constexpr std::string_view kPngStart("\x89PNG\r\n\x1a\n", 8), kJpegStart("\xff\xd8\xff", 3);
constexpr std::string_view kPngEnd("IEND\xae\x42\x60\x82", 8), kJpegEnd("\xff\xd9", 2);
constexpr std::streamoff kEndBytes = 256;  // some writers append a few bytes to a JPEG
constexpr int kMostMarkers = 1000;         // before the size of a JPEG

std::uint32_t big_endian(std::string_view bytes) {
  std::uint32_t value = 0;
  for (const char byte : bytes) value = value << 8 | static_cast<unsigned char>(byte);
  return value;
}

// Fewer where the file ends before.
std::string bytes_at(std::ifstream& file, std::streamoff place, std::size_t count) {
  std::string bytes(count, '\0');
  file.clear();
  file.seekg(place);
  file.read(bytes.data(), static_cast<std::streamsize>(count));
  bytes.resize(static_cast<std::size_t>(std::max<std::streamsize>(file.gcount(), 0)));
  return bytes;
}

std::optional<PictureFile> png(std::ifstream& file) {
  const std::string head = bytes_at(file, 0, 26);
  if (head.size() < 26 || head.compare(12, 4, "IHDR") != 0) return std::nullopt;
  const std::string_view view(head);
  constexpr std::array<int, 7> kChannels{
      1, 0, 3, 1, 2, 0, 4};  // by colour type: grey, colour, palette, grey and alpha, colour and alpha
  const auto type = static_cast<unsigned char>(head[25]);
  if (type >= kChannels.size() || kChannels[type] == 0) return std::nullopt;
  return PictureFile{big_endian(view.substr(16, 4)), big_endian(view.substr(20, 4)), head[24], kChannels[type]};
}

// bytes_from(place, count): fewer where the picture ends before.
template <class BytesFrom>
std::optional<PictureFile> jpeg(BytesFrom&& bytes_from) {
  std::size_t place = 2;
  for (int i = 0; i < kMostMarkers; ++i) {
    const auto marker = bytes_from(place, std::size_t{10});
    if (marker.size() < 10 || marker[0] != '\xff') return std::nullopt;
    const auto kind = static_cast<unsigned char>(marker[1]);
    const std::string_view view(marker);
    if (kind == 0xff) {  // a fill byte
      ++place;
      continue;
    }
    const bool is_frame = kind >= 0xc0 && kind <= 0xcf && kind != 0xc4 && kind != 0xc8 && kind != 0xcc;
    if (is_frame)
      return PictureFile{big_endian(view.substr(7, 2)), big_endian(view.substr(5, 2)), marker[4], marker[9]};
    place += 2 + big_endian(view.substr(2, 2));
  }
  return std::nullopt;
}

}  // namespace

PictureFile look_at_picture(const std::filesystem::path& path) {
  std::error_code problem;
  if (!std::filesystem::is_regular_file(path, problem))
    throw Error(ErrorCode::kMissing, "the picture is missing", path.string(), kCopyAgain);
  std::ifstream file(path, std::ios::binary);
  if (!file) throw Error(ErrorCode::kMissing, "the picture cannot be opened", path.string(), "check its permissions");
  const std::string start = bytes_at(file, 0, kPngStart.size());
  const bool is_png = start == kPngStart, is_jpeg = start.compare(0, kJpegStart.size(), kJpegStart) == 0;
  const auto bytes = static_cast<std::streamoff>(std::filesystem::file_size(path, problem));
  const auto corrupt = [&](const std::string& what) {
    return Error(ErrorCode::kCorrupt, what + " (" + std::to_string(problem ? 0 : bytes) + " bytes)", path.string(),
                 kCopyAgain);
  };
  if (!is_png && !is_jpeg) throw corrupt("is no picture; PNG or JPEG was expected");
  const auto in_file = [&](std::size_t place, std::size_t count) {
    return bytes_at(file, static_cast<std::streamoff>(place), count);
  };
  const auto found = is_png ? png(file) : jpeg(in_file);
  if (!found || found->width == 0 || found->height == 0)
    throw corrupt("the picture's head is damaged; its size was expected there");
  const std::string end =
      bytes_at(file, std::max<std::streamoff>(bytes - kEndBytes, 0), static_cast<std::size_t>(kEndBytes));
  if (end.find(is_png ? kPngEnd : kJpegEnd) == std::string::npos)
    throw corrupt("the picture is cut short; its end mark was expected");
  return *found;
}

bool is_png_or_jpeg(const std::filesystem::path& path) {
  std::ifstream file(path, std::ios::binary);
  const std::string start = file ? bytes_at(file, 0, kPngStart.size()) : std::string();
  return start == kPngStart || start.compare(0, kJpegStart.size(), kJpegStart) == 0;
}

std::optional<PictureFile> jpeg_size(std::string_view bytes) {
  return jpeg([&](std::size_t place, std::size_t count) { return bytes.substr(std::min(place, bytes.size()), count); });
}

mrpt::math::CMatrix_u16 read_depth_picture(const std::filesystem::path& path) {
  const PictureFile found = look_at_picture(path);
  if (found.bits != 16 || found.channels != 1)
    throw Error(ErrorCode::kBadInput,
                "a depth picture has " + std::to_string(found.channels) + " channel(s) of " +
                    std::to_string(found.bits) + " bits; one of 16 bits was expected",
                path.string(), "write depth as 16-bit grey PNG, depth_scale steps to the metre");
  cv::Mat image;
  try {
    image = cv::imread(path.string(), cv::IMREAD_UNCHANGED);
  } catch (const std::exception&) {
    image.release();
  }
  if (image.empty() || image.type() != CV_16UC1)
    throw Error(ErrorCode::kCorrupt, "the depth picture cannot be decoded", path.string(), kCopyAgain);
  mrpt::math::CMatrix_u16 depth(image.rows, image.cols);
  for (int row = 0; row < image.rows; ++row)
    std::memcpy(&depth(row, 0), image.ptr<std::uint16_t>(row),
                static_cast<std::size_t>(image.cols) * sizeof(std::uint16_t));
  return depth;
}

}  // namespace mapweave::rawlog
