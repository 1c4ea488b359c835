#include "object_walk.h"

#include "picture_file.h"

#include <mapweave/core/error.h>
#include <mrpt/obs/CObservationIMU.h>
#include <mrpt/rtti/CObject.h>

#include <algorithm>
#include <cstring>
#include <optional>
#include <string>
#include <utility>

namespace mapweave::rawlog {
namespace {

constexpr char kEndFlag = '\x88';
constexpr std::size_t kDeepest = 8;
constexpr std::uint32_t kMostParticles = 1'000'000, kLongestSide = 65535;
constexpr const char* kRemedy =
    "record or copy the log again; slam and run map what precedes this place with --keep-going";

bool is_name_letter(char c) {
  return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == ':' ||
         c == '<' || c == '>' || c == ',';
}

bool can_be_made(std::string_view class_name) {
  const auto* class_id = mrpt::rtti::findRegisteredClass(std::string(class_name));
  return class_id != nullptr && class_id->ptrCreateObject != nullptr;
}

// The bytes of an object: what its parts are made of.
class ObjectBytes {
 public:
  ObjectBytes(ByteSource& source, std::uint64_t most_bytes) : source_(source), most_bytes_(most_bytes) {}

 protected:
  ObjectHeader header() {
    ObjectHeader found;
    const auto first = number<std::uint8_t>();
    found.has_end_flag = (first & 0x80) != 0;
    found.name_length = first & 0x7f;
    if (!found.has_end_flag && (number<std::uint8_t>() != 0 || number<std::uint16_t>() != 0)) throw no_header();
    if (found.name_length == 0 || found.name_length > found.name.size()) throw no_header();
    const auto name = bytes(found.name_length);
    if (!std::all_of(name.begin(), name.end(), is_name_letter)) throw no_header();
    std::copy(name.begin(), name.end(), found.name.begin());
    if (!found.has_end_flag) {
      const auto version = number<std::int32_t>();
      if (version < 0 || version > 254) throw corrupt("class version " + std::to_string(version) + " cannot be");
      found.version = version;
    } else if (found.class_name() != "nullptr") {
      found.version = number<std::uint8_t>();
    }
    return found;
  }

  bool end(const ObjectHeader& object_header) {
    if (object_header.has_end_flag && number<char>() != kEndFlag)
      throw corrupt("lacks its end flag; 0x88 was expected");
    return true;
  }
  bool text() {
    array(number<std::uint32_t>(), 1, "letters");
    return true;
  }
  void array(std::uint64_t count, std::size_t bytes_each, const char* what, bool take = true) {
    if (count * bytes_each > most_bytes_) {
      throw corrupt("announces " + std::to_string(count) + " " + what + ", more than an object may hold (" +
                    std::to_string(most_bytes_) + " bytes)");
    }
    if (source_.ahead(at_ + count * bytes_each).size() < at_ + count * bytes_each) throw cut_short(count * bytes_each);
    if (take) at_ += count * bytes_each;
  }
  bool skip(std::size_t count) {
    bytes(count);
    return true;
  }
  std::string_view bytes(std::size_t count) {
    const auto view = source_.ahead(at_ + count);
    if (view.size() < at_ + count) throw cut_short(count);
    at_ += count;
    return view.substr(at_ - count, count);
  }
  template <class T>
  T number() {  // little-endian, as MRPT writes
    T value;
    std::memcpy(&value, bytes(sizeof value).data(), sizeof value);
    return value;
  }

  Error cut_short(std::size_t needed) {
    source_.throw_damage();
    const auto remain = source_.ahead(0).size() - std::min(at_, source_.ahead(0).size());
    return corrupt("is cut short: " + std::to_string(needed) + " bytes are needed, " + std::to_string(remain) +
                   " remain");
  }
  Error no_header() { return corrupt("the name of a class was expected here"); }
  Error corrupt(const std::string& what) const {
    return Error(ErrorCode::kCorrupt,
                 (within_ == nullptr ? "" : "an object of class '" + std::string(within_->class_name()) + "': ") + what,
                 source_.place(source_.position() + at_), kRemedy);
  }
  void cells() {
    const auto rows = number<std::uint32_t>(), columns = number<std::uint32_t>();
    if (rows > kLongestSide || columns > kLongestSide)
      throw corrupt("announces a depth picture of " + std::to_string(rows) + " x " + std::to_string(columns));
    array(std::uint64_t{rows} * columns, 2, "cells");
  }
  bool bytes_counted() {
    array(number<std::uint32_t>(), 1, "bytes");
    return true;
  }
  bool flag() { return number<std::uint8_t>() != 0; }
  bool pixels(std::int64_t width, std::int64_t height, std::size_t bytes_each) {
    if (width < 0 || height < 0 || width > kLongestSide || height > kLongestSide ||
        static_cast<std::uint64_t>(width * height) * bytes_each > most_bytes_)
      throw corrupt("announces a picture of " + std::to_string(width) + " x " + std::to_string(height) + " pixels");
    pixel_bytes_ = static_cast<std::size_t>(width * height) * bytes_each;
    return true;
  }
  bool jpeg() {
    const auto count = number<std::uint32_t>();
    const std::size_t start = at_;
    array(count, 1, "bytes");
    if (const auto size = jpeg_size(source_.ahead(at_).substr(start, count))) pixels(size->width, size->height, 3);
    return true;
  }
  bool matrix(std::size_t cell_bytes) {
    const auto rows = number<std::uint32_t>(), columns = number<std::uint32_t>();
    if (rows > kLongestSide || columns > kLongestSide)
      throw corrupt("announces a matrix of " + std::to_string(rows) + " x " + std::to_string(columns));
    array(rows * columns, cell_bytes, "cells");
    return true;
  }
  bool particles() {
    array(number<std::uint32_t>(), 8 + 3 * 8, "particles");
    return true;
  }
  // MRPT's version 0 reads pixels past the room that it made for them.
  bool image(int version) {
    if (version == 0 || (version > 9 && version != 100))
      throw corrupt("its version " + std::to_string(version) + " is not known");
    if (version >= 6 && flag()) return text();
    if (version == 100) throw corrupt("a picture outside the log was expected");
    if (version == 1) return jpeg();
    if (flag()) {  // colour
      if (version < 7) return jpeg();
      const auto width = number<std::int32_t>(), height = number<std::int32_t>();
      if (width > 0 && height > 0) return pixels(width, height, 3) && jpeg();
      if (width < 0 && height < 0) return pixels(-std::int64_t{width}, -std::int64_t{height}, 3) && skip(pixel_bytes_);
      return pixels(width, height, 3);
    }
    const auto width = number<std::int32_t>(), height = number<std::int32_t>();
    skip(4);  // origin
    const auto announced = number<std::uint32_t>();
    constexpr std::array<std::size_t, 7> kDepthBytes{1, 1, 2, 2, 4, 4, 8};
    const auto kind = version >= 9 ? number<std::uint32_t>() : 0;
    if (kind >= kDepthBytes.size()) throw corrupt("announces pixels of the unknown kind " + std::to_string(kind));
    pixels(width, height, kDepthBytes[kind]);
    const bool is_packed = version == 3 || (version == 4 && announced > 16 * 1024) || (version >= 5 && flag());
    if (is_packed) return bytes_counted();
    if (announced != pixel_bytes_)
      throw corrupt("announces " + std::to_string(announced) + " bytes for " + std::to_string(width) + " x " +
                    std::to_string(height) + " pixels");
    array(announced, 1, "bytes");
    return true;
  }

  ByteSource& source_;
  std::uint64_t most_bytes_;
  std::size_t at_ = 0;                    // from the source's position
  std::size_t pixel_bytes_ = 0;           // of the picture last announced
  const ObjectHeader* within_ = nullptr;  // the innermost object
};

class Walker : ObjectBytes {
 public:
  using ObjectBytes::ObjectBytes;

  ObjectHeader walk() {
    ObjectHeader found = header();
    found.is_known = object(found, 0, 0);
    return found;
  }

 private:
  // What a frame or collection holds: false where its layout is not known here.
  bool nested(std::size_t depth, bool must_be_known = false) {
    if (depth >= kDeepest) throw corrupt("objects are nested deeper than " + std::to_string(kDeepest));
    const std::size_t start = at_;
    const ObjectHeader found = header();
    const bool is_known = object(found, start, depth + 1);
    if (!is_known && must_be_known)
      throw corrupt("holds an object of class '" + std::string(found.class_name()) + "' and version " +
                    std::to_string(found.version) + ", which is not known there");
    return is_known;
  }
  // What an object that is known here is made of: MRPT would believe the lengths of whatever stands in its place.
  void part(std::size_t depth) { nested(depth, true); }

  // False where the walk met a class or version whose layout is not known here: nothing is said about what follows.
  bool object(const ObjectHeader& object_header, std::size_t start, std::size_t depth) {
    if (object_header.version < 0) return end(object_header);
    const ObjectHeader* outer = std::exchange(within_, &object_header);
    const std::optional<bool> known = body(object_header.short_name(), object_header.version, depth);
    if (!known && !can_be_made(object_header.class_name())) {
      throw Error(ErrorCode::kUnsupported,
                  "holds an object of class '" + std::string(object_header.class_name()) + "', which cannot be read",
                  source_.place(source_.position() + start),
                  "remove these objects with MRPT's rawlog-edit, or check that the file is a rawlog");
    }
    const bool whole = known.value_or(false) && end(object_header);
    within_ = outer;
    return whole;
  }

  // nullopt: a class whose layout is not known here.
  std::optional<bool> body(std::string_view name, int version, std::size_t depth) {
    if (name == "CObservation2DRangeScan") {
      // MRPT would make room for whatever number of rays an older version announces.
      if (version < 4 || version > 7) throw corrupt("its version " + std::to_string(version) + " is not known");
      return scan(version, depth);
    }
    if (name == "CObservationOdometry") return version <= 2 && odometry(version, depth);
    if (name == "CSensoryFrame" || name == "CActionCollection") {
      if (depth > 0) throw corrupt("stands within another object");
      if (version > (name == "CSensoryFrame" ? 2 : 0))
        throw corrupt("its version " + std::to_string(version) + " is not known");
      return name == "CSensoryFrame" ? frame(version, depth) : objects(depth);
    }
    if (name == "CActionRobotMovement2D") {
      if (version < 5 || version > 7) throw corrupt("its version " + std::to_string(version) + " is not known");
      return movement(version, depth);
    }
    if (name == "CObservationComment") return version == 0 && text() && skip(8);
    if (name == "CImage") return image(version);
    if (name == "CObservationImage") return version <= 4 && picture(version, depth);
    if (name == "CObservationStereoImages") return version <= 6 && stereo(version, depth);
    if (name == "CObservation3DRangeScan") return version <= 10 && depth_scan(version, depth);
    if (name == "CObservationIMU") return version <= 4 && imu(version, depth);
    if (name == "CObservationGPS") return version >= 10 && satellites(depth);
    if (name == "TCamera") return version <= 6 && camera(version, depth);
    if (name == "CPose3DQuat") return version == 0 && skip(7 * 8);
    if (name == "CPose2D") return version == 1 && skip(3 * 8);
    if (name == "CPose3D") return pose3(version, depth);
    if (name == "CPosePDFGaussian") return version == 2 && gaussian(depth);
    if (name == "CPosePDFGaussianInf") return version == 0 && skip(3 * 8 + 6 * 8);
    if (name == "CPosePDFParticles") return version == 1 && particles();
    if (name == "CPosePDFSOG") return version == 2 && gaussians(depth);
    if (name == "CMatrixD" || name == "CMatrixF") return version == 0 && matrix(name == "CMatrixD" ? 8 : 4);
    return std::nullopt;
  }

  bool scan(int version, std::size_t depth) {
    skip(4 + 1 + 4);  // aperture, direction, maximum
    part(depth);
    if (version < 6) part(depth);
    const auto rays = number<std::uint32_t>();
    array(rays, 4 + 1, "rays");
    skip(4 + 8 + 4);  // range deviation, stamp, beam width
    if (version >= 5) {
      text();
      skip(8);
    }
    if (version >= 7 && number<std::uint8_t>() != 0) array(rays, 4, "intensities");
    return true;
  }
  bool odometry(int version, std::size_t depth) {
    part(depth);
    text();
    skip(8);
    if (version == 1) skip(1 + 8 + 1 + 8);
    if (version == 2) {
      if (number<std::uint8_t>() != 0) skip(8);
      if (number<std::uint8_t>() != 0) skip(3 * 8);
    }
    return true;
  }
  bool gaussian(std::size_t depth) {
    part(depth);
    return skip(6 * 8);  // the covariance, which is symmetric
  }
  bool gaussians(std::size_t depth) {
    const auto count = number<std::uint32_t>();
    array(count, 8 + 6 * 8, "Gaussians", false);
    for (std::uint32_t i = 0; i < count; ++i) {
      skip(8);  // its weight
      gaussian(depth);
    }
    return true;
  }
  bool frame(int version, std::size_t depth) {
    if (version < 2) skip(4);
    if (version == 0) skip(8);
    return objects(depth);
  }
  bool objects(std::size_t depth) {
    const auto count = number<std::uint32_t>();
    array(count, 2, "objects", false);
    for (std::uint32_t i = 0; i < count; ++i) {
      if (!nested(depth)) return false;
    }
    return true;
  }
  bool movement(int version, std::size_t depth) {
    const auto method = number<std::int32_t>();
    part(depth);
    if (method == 0) {  // from odometry: the motion model stands here
      skip(4 + 6 * 4);
      const auto particles = number<std::uint32_t>();
      if (particles > kMostParticles) throw corrupt("announces " + std::to_string(particles) + " particles");
      skip(6 * 4);
    }
    if (version < 7) {
      skip(1 + 8 + 1 + 8);
    } else {
      if (number<std::uint8_t>() != 0) skip(3 * 8);
      if (number<std::uint8_t>() != 0) skip(8);
    }
    return version < 6 || skip(8);
  }
  bool camera(int version, std::size_t depth) {
    skip(8 + (version >= 3 ? 8 : 5) * 8);
    if (version >= 4)
      skip(4 * 8);
    else
      part(depth);
    if (version == 0) part(depth);
    if (version >= 2) skip(2 * 4);
    if (version >= 5) text();
    return version < 6 || skip(1);
  }
  bool picture(int version, std::size_t depth) {
    for (int i = version >= 4 ? 3 : 4; i > 0;
         --i) {  // pose, calibration (of two matrices in the older versions), picture
      part(depth);
    }
    if (version >= 1) skip(8);
    if (version == 2 || version == 3) skip(8);
    return version < 3 || text();
  }
  bool stereo(int version, std::size_t depth) {
    for (int i = version >= 5 ? 4 : 3; i > 0; --i) {  // pose, calibrations, left picture
      part(depth);
    }
    const bool has_disparity = version >= 6 && flag(), has_right = version < 6 || flag();
    if (has_right) part(depth);
    if (has_disparity) part(depth);
    if (version >= 1) skip(8);
    if (version >= 2) part(depth);
    if (version == 3 || version == 4) skip(8);
    return version < 4 || text();
  }
  bool depth_scan(int version, std::size_t depth) {
    skip(4);  // maximum
    part(depth);
    if (version == 0 || flag()) array(number<std::uint32_t>(), version == 0 ? 13 : version < 8 ? 12 : 16, "points");
    if (version >= 1) {
      const bool has_ranges = flag();
      if (version >= 9) skip(4);
      if (has_ranges && version < 9) part(depth);
      if (has_ranges && version >= 9) cells();
      for (int i = 0; i < 2; ++i) {  // intensity, confidence
        if (flag()) part(depth);
      }
      for (int i = version >= 4 ? 3 : version >= 2 ? 1 : 0; i > 0; --i) {  // calibrations, pose
        part(depth);
      }
    }
    skip(4 + 8);
    text();
    if (version >= 3) {
      skip(1);
      text();
      skip(1);
      text();
    }
    skip((version >= 5 ? 1 : 0) + (version >= 6 ? 1 : 0));
    if (version >= 7 && flag()) return false;  // labels of pixels
    if (version < 10) return true;
    for (auto layers = number<std::uint8_t>(); layers > 0; --layers) {
      text();
      cells();
    }
    return true;
  }
  bool imu(int version, std::size_t depth) {
    part(depth);
    const std::size_t fields = mrpt::obs::COUNT_IMU_DATA_FIELDS;
    if (version == 4) return skip(fields + 8 + 8 * fields) && text();
    bytes_counted();
    skip(8);
    array(number<std::uint32_t>(), version == 0 ? 4 : 8, "measurements");
    return text();
  }
  bool satellites(std::size_t depth) {
    skip(2 * 8);
    text();
    part(depth);
    return false;  // then come messages of many kinds
  }
  bool pose3(int version, std::size_t depth) {
    if (version <= 1) {
      part(depth);
      return true;
    }
    return version == 2 ? skip(7 * 8) : version == 3 && skip(12 * 8);
  }
};

}  // namespace

ObjectHeader check_object(ByteSource& source, std::uint64_t most_bytes) { return Walker(source, most_bytes).walk(); }

}  // namespace mapweave::rawlog
