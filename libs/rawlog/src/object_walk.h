#pragma once
// Looks ahead over one serialized MRPT object before MRPT reads it. MRPT believes every length it reads and makes room
// for it at once; here each length is held against what the file really has.

#include "byte_source.h"

#include <array>
#include <string_view>

namespace mapweave::rawlog {

struct ObjectHeader {
  static constexpr std::size_t kLongestName = 120;
  std::array<char, kLongestName> name{};
  std::size_t name_length = 0;
  int version = -1;          // -1: the null object
  bool has_end_flag = true;  // absent before MRPT 0.5.5
  bool is_known = false;     // every length in it was held against the file

  std::size_t bytes() const { return has_end_flag ? 1 + name_length + (version < 0 ? 0 : 1) : 4 + name_length + 4; }
  std::string_view short_name() const {
    const auto colon = class_name().rfind(':');
    return colon == std::string_view::npos ? class_name() : class_name().substr(colon + 1);
  }
  std::string_view class_name() const {
    return {name.data(), name_length};
  }  // "mrpt::obs::CObservationOdometry"; older logs: "CObservationOdometry"
};

// Throws Error: kCorrupt for sizes that cannot be, an object that the file does not hold whole or that lacks its end
// flag, and for a part of another class than it is made of; kUnsupported for a class that MRPT does not know, here or
// within. Observations of other classes than lasers, odometry, cameras, inertial units and comments are looked at no
// further than their name (is_known): MRPT takes room for whatever they announce. `most_bytes`: an object that
// announces more is damage.
ObjectHeader check_object(ByteSource& source, std::uint64_t most_bytes);

}  // namespace mapweave::rawlog
