#include "object_walk.h"

#include <mapweave/core/error.h>
#include <mrpt/rtti/CObject.h>

#include <algorithm>
#include <cctype>
#include <cstring>
#include <optional>
#include <string_view>

namespace mapweave::rawlog {
namespace {

constexpr char kEndFlag = '\x88';
constexpr std::size_t kLongestName = 120, kDeepest = 8;
constexpr std::uint32_t kMostParticles = 1'000'000;
constexpr const char* kRemedy = "record or copy the log again; what precedes this place can be used (split --at)";

class Walker {
 public:
  Walker(ByteSource& source, std::uint64_t most_bytes, std::size_t at = 0) : source_(source), most_bytes_(most_bytes), at_(at) {}

  // False where the walk met a class or version whose layout is not known here: nothing is said about what follows.
  bool object(std::size_t depth = 0) {
    if (depth > kDeepest) throw corrupt("objects are nested deeper than " + std::to_string(kDeepest));
    const std::size_t start = at_;
    const ObjectHeader object_header = header();
    if (object_header.version < 0) return end(object_header);
    const std::string_view name = short_name(object_header.class_name);
    within_ = object_header.class_name;
    const std::optional<bool> known = body(name, object_header.version, depth);
    if (!known && mrpt::rtti::findRegisteredClass(object_header.class_name) == nullptr) {
      throw Error(ErrorCode::kUnsupported, "holds an object of class '" + object_header.class_name + "', which MRPT 2.5.8 does not know",
                  source_.place(source_.position() + start), "remove these objects with MRPT's rawlog-edit, or check that the file is a rawlog");
    }
    within_ = object_header.class_name;
    return known.value_or(false) && end(object_header);
  }

  ObjectHeader header() {
    ObjectHeader found;
    const auto first = number<std::uint8_t>();
    found.has_end_flag = (first & 0x80) != 0;
    const std::size_t length = first & 0x7f;
    if (!found.has_end_flag && (number<std::uint8_t>() != 0 || number<std::uint16_t>() != 0)) throw no_header();
    if (length == 0 || length > kLongestName) throw no_header();
    found.class_name.assign(bytes(length));
    if (!std::all_of(found.class_name.begin(), found.class_name.end(),
                     [](unsigned char c) { return std::isalnum(c) != 0 || c == '_' || c == ':' || c == '<' || c == '>' || c == ','; })) {
      throw no_header();
    }
    if (!found.has_end_flag) {
      const auto version = number<std::int32_t>();
      if (version < 0 || version > 254) throw corrupt("class version " + std::to_string(version) + " cannot be");
      found.version = version;
    } else if (found.class_name != "nullptr") {
      found.version = number<std::uint8_t>();
    }
    found.body = at_;
    return found;
  }

 private:
  static std::string_view short_name(std::string_view name) {
    const auto colon = name.rfind(':');
    return colon == std::string_view::npos ? name : name.substr(colon + 1);
  }

  // nullopt: a class whose layout is not known here.
  std::optional<bool> body(std::string_view name, int version, std::size_t depth) {
    if (name == "CObservation2DRangeScan") return version >= 4 && version <= 7 && scan(version, depth);
    if (name == "CObservationOdometry") return version <= 2 && odometry(version, depth);
    if (name == "CSensoryFrame") return version <= 2 && frame(version, depth);
    if (name == "CActionCollection") return version == 0 && objects(depth);
    if (name == "CActionRobotMovement2D") return version >= 5 && version <= 7 && movement(version, depth);
    if (name == "CObservationComment") return version == 0 && text() && skip(8) && text();
    if (name == "CPose2D") return version == 1 && skip(3 * 8);
    if (name == "CPose3D") return pose3(version, depth);
    if (name == "CMatrixD" || name == "CMatrixF") return version == 0 && matrix(name == "CMatrixD" ? 8 : 4);
    return std::nullopt;
  }

  bool scan(int version, std::size_t depth) {
    skip(4 + 1 + 4);  // aperture, direction, maximum
    if (!object(depth + 1)) return false;
    if (version < 6 && !object(depth + 1)) return false;
    const auto rays = number<std::uint32_t>();
    array(rays, 4 + 1, "rays");
    skip(4 + 8 + 4);  // range deviation, stamp, beam width
    if (version >= 5) text(), skip(8);
    if (version >= 7 && number<std::uint8_t>() != 0) array(rays, 4, "intensities");
    return true;
  }
  bool odometry(int version, std::size_t depth) {
    if (!object(depth + 1)) return false;
    text(), skip(8);
    if (version == 1) skip(1 + 8 + 1 + 8);
    if (version == 2) {
      if (number<std::uint8_t>() != 0) skip(8);
      if (number<std::uint8_t>() != 0) skip(3 * 8);
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
      if (!object(depth + 1)) return false;
    }
    return true;
  }
  bool movement(int version, std::size_t depth) {
    const auto method = number<std::int32_t>();
    if (!object(depth + 1)) return false;
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
  bool pose3(int version, std::size_t depth) {
    if (version <= 1) return object(depth + 1);
    return version == 2 ? skip(7 * 8) : version == 3 && skip(12 * 8);
  }
  bool matrix(std::size_t cell_bytes) {
    const auto rows = number<std::uint32_t>(), columns = number<std::uint32_t>();
    if (rows > 65535 || columns > 65535) throw corrupt("announces a matrix of " + std::to_string(rows) + " x " + std::to_string(columns));
    array(rows * columns, cell_bytes, "cells");
    return true;
  }

  bool end(const ObjectHeader& object_header) {
    if (object_header.has_end_flag && number<char>() != kEndFlag) throw corrupt("lacks its end flag; 0x88 was expected");
    return true;
  }
  bool text() {
    array(number<std::uint32_t>(), 1, "letters");
    return true;
  }
  void array(std::uint64_t count, std::size_t bytes_each, const char* what, bool take = true) {
    if (count * bytes_each > most_bytes_) {
      throw corrupt("announces " + std::to_string(count) + " " + what + ", more than an object may hold (" + std::to_string(most_bytes_) + " bytes)");
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
    return corrupt("is cut short: " + std::to_string(needed) + " bytes are needed, " + std::to_string(remain) + " remain");
  }
  Error no_header() { return corrupt("the name of a class was expected here"); }
  Error corrupt(const std::string& what) const {
    return Error(ErrorCode::kCorrupt, (within_.empty() ? "" : "an object of class '" + within_ + "': ") + what, source_.place(source_.position() + at_), kRemedy);
  }

  ByteSource& source_;
  std::uint64_t most_bytes_;
  std::size_t at_;
  std::string within_;
};

}  // namespace

ObjectHeader read_header(ByteSource& source, std::size_t offset) { return Walker(source, 0, offset).header(); }

void check_object(ByteSource& source, std::uint64_t most_bytes) { Walker(source, most_bytes).object(); }

}  // namespace mapweave::rawlog
