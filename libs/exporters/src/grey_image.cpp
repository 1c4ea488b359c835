#include "grey_image.h"

#include <mapweave/core/error.h>

#include <zlib.h>
#include <cctype>
#include <opencv2/imgcodecs.hpp>

namespace mapweave::exporters {
namespace {

constexpr std::int64_t kMostPixels = std::int64_t{1} << 28;  // 16384 x 16384

[[noreturn]] void refuse(const std::string& what, const std::string& where) {
  throw Error(ErrorCode::kCorrupt, what, where, "save the image again as an 8-bit grey PGM or PNG");
}

void check_size(std::int64_t columns, std::int64_t rows, const std::string& where) {
  if (columns < 1 || rows < 1)
    refuse("the image has no pixels: " + std::to_string(columns) + " x " + std::to_string(rows), where);
  if (columns > kMostPixels / rows)
    throw Error(ErrorCode::kUnsupported,
                "the image has " + std::to_string(columns) + " x " + std::to_string(rows) + " pixels; up to " +
                    std::to_string(kMostPixels) + " can be read",
                where, "cut it, or scale it down and multiply the key 'resolution' by the same factor");
}

// Reads the numbers of a PGM header, and of the pixels of P2.
class PgmText {
 public:
  PgmText(std::string_view bytes, const std::string& where) : bytes_(bytes), where_(where) {}
  std::size_t position() const { return position_; }

  std::int64_t number(const char* what, std::int64_t most) {
    skip_blanks_and_comments();
    const std::size_t begin = position_;
    std::int64_t value = 0;
    for (; position_ < bytes_.size() && std::isdigit(static_cast<unsigned char>(bytes_[position_])) != 0; ++position_) {
      value = value * 10 + (bytes_[position_] - '0');
      if (value > most) refuse(std::string(what) + " is larger than " + std::to_string(most), at());
    }
    if (position_ == begin)
      refuse(std::string(position_ == bytes_.size() ? "the file ends" : "something else stands") + " where " + what +
                 " should be",
             at());
    return value;
  }

  void one_blank() {
    if (position_ == bytes_.size() || std::isspace(static_cast<unsigned char>(bytes_[position_])) == 0)
      refuse("no blank after the header", at());
    ++position_;
  }

 private:
  void skip_blanks_and_comments() {
    for (; position_ < bytes_.size(); ++position_) {
      if (bytes_[position_] == '#')
        position_ = std::min(bytes_.find('\n', position_), bytes_.size() - 1);
      else if (std::isspace(static_cast<unsigned char>(bytes_[position_])) == 0)
        return;
    }
  }
  std::string at() const { return where_ + " at byte " + std::to_string(position_); }

  std::string_view bytes_;
  const std::string& where_;
  std::size_t position_ = 2;  // after P2 or P5
};

std::uint8_t shade(std::int64_t value, std::int64_t largest) {
  return static_cast<std::uint8_t>((value * 255 + largest / 2) / largest);
}

MapServerImage decode_pgm(std::string_view bytes, const std::string& where) {
  const bool text = bytes[1] == '2';
  PgmText header(bytes, where);
  const std::int64_t columns = header.number("the width", INT32_MAX), rows = header.number("the height", INT32_MAX);
  const std::int64_t largest = header.number("the largest shade", 65535);
  check_size(columns, rows, where);
  if (largest < 1) refuse("the largest shade is 0", where);

  // Sizes are compared before memory is asked for.
  const std::int64_t pixels = columns * rows;
  const std::int64_t bytes_per_pixel = text ? 2 : largest > 255 ? 2 : 1;  // text: a digit and a blank at least
  if (!text) header.one_blank();
  const auto remaining = static_cast<std::int64_t>(bytes.size() - header.position());
  if (remaining < pixels * bytes_per_pixel - (text ? 1 : 0))
    refuse("the image is cut short: " + std::to_string(columns) + " x " + std::to_string(rows) + " pixels need " +
               std::to_string(pixels * bytes_per_pixel) + " bytes, " + std::to_string(remaining) + " remain",
           where);
  if (!text && remaining > pixels * bytes_per_pixel + 2)
    refuse("the header says " + std::to_string(columns) + " x " + std::to_string(rows) + " pixels, but there are " +
               std::to_string(remaining - pixels * bytes_per_pixel) + " bytes more",
           where);

  MapServerImage image{static_cast<std::int32_t>(columns), static_cast<std::int32_t>(rows), {}, {}};
  image.shades.reserve(static_cast<std::size_t>(pixels));
  std::size_t at = header.position();
  for (std::int64_t pixel = 0; pixel < pixels; ++pixel) {
    std::int64_t value = 0;
    if (text) {
      value = header.number("a shade", largest);
    } else {
      for (std::int64_t byte = 0; byte < bytes_per_pixel; ++byte)
        value = value * 256 + static_cast<unsigned char>(bytes[at++]);
      value = std::min(value, largest);
    }
    image.shades.push_back(shade(value, largest));
  }
  return image;
}

// The chunks of a PNG with their checksums: all of it is there and whole before a decoder is trusted with it.
void check_png(std::string_view bytes, const std::string& where) {
  const auto number_at = [&](std::size_t at) {
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<unsigned char>(bytes[at + i]);
    return value;
  };
  if (bytes.size() < 33 || bytes.substr(12, 4) != "IHDR") refuse("the image is cut short within its header", where);
  check_size(number_at(16), number_at(20), where);
  for (std::size_t at = 8; at + 12 <= bytes.size();) {
    const std::size_t length = number_at(at);
    if (length > bytes.size() - at - 12) break;
    const auto checksum =
        crc32(0, reinterpret_cast<const unsigned char*>(bytes.data()) + at + 4, static_cast<unsigned>(length) + 4);
    if (checksum != number_at(at + 8 + length))
      refuse("the image is damaged: a checksum does not match", where + " at byte " + std::to_string(at));
    if (bytes.substr(at + 4, 4) == "IEND") return;
    at += length + 12;
  }
  refuse("the image is cut short: its " + std::to_string(bytes.size()) + " bytes have no end mark", where);
}

MapServerImage decode_png(std::string_view bytes, const std::string& where) {
  check_png(bytes, where);
  cv::Mat decoded;
  try {
    const cv::Mat encoded(1, static_cast<int>(bytes.size()), CV_8U, const_cast<char*>(bytes.data()));
    decoded = cv::imdecode(encoded, cv::IMREAD_UNCHANGED);
  } catch (const cv::Exception&) {
    decoded.release();
  }
  const int channels = decoded.channels();
  if (decoded.empty() || (decoded.depth() != CV_8U && decoded.depth() != CV_16U) || channels == 2 || channels > 4)
    refuse("the image cannot be decoded", where);

  MapServerImage image{decoded.cols, decoded.rows, {}, {}};
  image.shades.reserve(decoded.total());
  const auto value_at = [&](int row, int index) {
    return decoded.depth() == CV_8U ? decoded.ptr<std::uint8_t>(row)[index]
                                    : decoded.ptr<std::uint16_t>(row)[index] >> 8;
  };
  const int colours = channels == 1 ? 1 : 3;
  if (channels == 4) image.transparent.reserve(decoded.total());
  for (int row = 0; row < decoded.rows; ++row) {
    for (int column = 0; column < decoded.cols; ++column) {
      int sum = 0;
      for (int colour = 0; colour < colours; ++colour) sum += value_at(row, column * channels + colour);
      image.shades.push_back(static_cast<std::uint8_t>((sum + colours / 2) / colours));
      if (channels == 4) image.transparent.push_back(value_at(row, column * channels + 3) < 255);
    }
  }
  return image;
}

}  // namespace

MapServerImage grey_image(const OccupancyGrid& grid) {
  MAPWEAVE_EXPECT(!grid.empty(), "a grid without cells has no picture");
  MapServerImage image{grid.columns, grid.rows, {}, {}};
  image.shades.reserve(grid.log_odds.size());
  for (std::int32_t row = grid.rows - 1; row >= 0; --row)
    for (std::int32_t column = 0; column < grid.columns; ++column) {
      const std::int16_t log_odds = grid.at(column, row);
      image.shades.push_back(log_odds == OccupancyGrid::kUnknown ? kUnknownShade
                             : log_odds > 0                      ? kWallShade
                                                                 : kFreeShade);
    }
  return image;
}

MapServerImage decode_image(std::string_view bytes, const std::string& where) {
  if (bytes.size() >= 2 && bytes[0] == 'P' && (bytes[1] == '2' || bytes[1] == '5')) return decode_pgm(bytes, where);
  if (bytes.substr(0, 8) == "\x89PNG\r\n\x1a\n") return decode_png(bytes, where);
  throw Error(ErrorCode::kUnsupported,
              bytes.empty() ? "the image is empty" : "the image is neither PGM (P2, P5) nor PNG", where,
              "convert it to an 8-bit grey PGM or PNG");
}

}  // namespace mapweave::exporters
