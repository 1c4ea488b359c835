#pragma once
// What bags hold compressed. The claimed size of what comes out is a limit and no reason to ask for memory: a buffer
// grows with what was unpacked.

#include <cstddef>
#include <filesystem>
#include <string>
#include <string_view>
#include <vector>

namespace mapweave::rawlog::ros {

constexpr std::size_t kMostUnpackedBytes = std::size_t{1} << 30;  // of a chunk or a message

// One lz4 frame (and what follows it, as far as it is one, too). `to` is replaced.
// Throws Error kCorrupt without place: damage, or more than `most` bytes.
void unpack_lz4(std::string_view packed, std::size_t most, std::vector<char>& to);
// As unpack_lz4(), zstd frames.
void unpack_zstd(std::string_view packed, std::size_t most, std::vector<char>& to);
bool is_zstd(std::string_view bytes);  // by the mark at its beginning

// A file that zstd compressed, unpacked into a new file at `to`. Throws Error: kMissing, kCorrupt (naming `from`),
// kCannotWrite.
void unpack_zstd_file(const std::filesystem::path& from, const std::filesystem::path& to);

}  // namespace mapweave::rawlog::ros
