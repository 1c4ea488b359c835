#pragma once
// Encoded bytes as they lie in a store: compressed with zstd, with the SHA-256 of the plain bytes.

#include <mapweave/core/hash.h>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace mapweave::mapdb {

struct PackedBlob {
  std::int64_t bytes = 0;  // plain
  Hash sha256;             // of the plain bytes
  std::string zstd;
};

// A hash as it lies in a column.
std::string_view view_of(const Hash& hash);                     // must outlive it
std::optional<Hash> hash_from_column(std::string_view column);  // nullopt: it is of another length

PackedBlob pack(std::string_view plain);
// Throws Error(kCorrupt) for what does not give `bytes` bytes of that hash. Allocates no more than that, at most
// 1 GiB, and no more than so many compressed bytes can hold.
std::string unpack(std::string_view zstd, std::int64_t bytes, const Hash& sha256, const std::string& where);

}  // namespace mapweave::mapdb
