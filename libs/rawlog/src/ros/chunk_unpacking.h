#pragma once
// The compressed chunks of a bag.

#include <cstddef>
#include <string>
#include <string_view>

namespace mapweave::rawlog::ros {

// What came out of a chunk.
struct UnpackedChunk {
  std::string bytes;
  // Why unpacking stopped before the chunk's end; empty where it did not.
  std::string problem;
};

// Unpacks a bzip2 stream of at most `most_bytes` once unpacked. Memory grows with what comes out, not with what a file
// claims.
UnpackedChunk unpack_bz2(std::string_view packed, std::size_t most_bytes);

// Unpacks frames of LZ4, which is also what ROS 1 writes as "lz4" (its roslz4 is the frame format with a block per
// chunk).
UnpackedChunk unpack_lz4(std::string_view packed, std::size_t most_bytes);

// Unpacks frames of zstd.
UnpackedChunk unpack_zstd(std::string_view packed, std::size_t most_bytes);

}  // namespace mapweave::rawlog::ros
