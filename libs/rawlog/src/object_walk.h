#pragma once
// Looks ahead over one serialized MRPT object before MRPT reads it. MRPT believes every length it reads and makes room for it at once; here each
// length is held against what the file really has.

#include "byte_source.h"

#include <string>

namespace mapweave::rawlog {

struct ObjectHeader {
  std::string class_name;      // "mrpt::obs::CObservationOdometry", or without the namespace in older logs
  int version = -1;            // -1 for the null object
  std::size_t body = 0;        // bytes before the body
  bool has_end_flag = true;    // absent in logs of 2006 and older
};

// Throws Error kCorrupt where the bytes are no header.
ObjectHeader read_header(ByteSource& source, std::size_t offset = 0);

// Throws Error: kCorrupt for lengths that cannot be, an object that the file does not hold whole or that lacks its end flag; kUnsupported for a
// class that MRPT does not know, here or within. Classes other than laser scans, odometry, actions, sensory frames and comments are looked
// at no further than their name. `most_bytes`: an object that announces more is damage.
void check_object(ByteSource& source, std::uint64_t most_bytes);

}  // namespace mapweave::rawlog
