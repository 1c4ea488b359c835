#include "packed_blob.h"

#include <mapweave/core/error.h>
#include <zstd.h>

#include <algorithm>

namespace mapweave::mapdb {
namespace {

constexpr int kLevel = 6;
constexpr std::int64_t kMostBytes = std::int64_t{1} << 30;  // as the byte form's
// What each byte can become: a block of zstd has 128 KiB at most and takes four bytes at least (RFC 8878, 3.1.1.2).
constexpr std::int64_t kMostGrowth = std::int64_t{128} << 8;

}  // namespace

std::string_view view_of(const Hash& hash) {
  return {reinterpret_cast<const char*>(hash.bytes.data()), hash.bytes.size()};
}

std::optional<Hash> hash_from_column(std::string_view column) {
  Hash hash;
  if (column.size() != hash.bytes.size()) return std::nullopt;
  std::copy(column.begin(), column.end(), hash.bytes.begin());
  return hash;
}

PackedBlob pack(std::string_view plain) {
  PackedBlob blob;
  blob.bytes = static_cast<std::int64_t>(plain.size());
  blob.sha256 = hash_of_bytes(plain);
  blob.zstd.resize(ZSTD_compressBound(plain.size()));
  const std::size_t size = ZSTD_compress(blob.zstd.data(), blob.zstd.size(), plain.data(), plain.size(), kLevel);
  if (ZSTD_isError(size)) throw Error(ErrorCode::kInternal, std::string("zstd: ") + ZSTD_getErrorName(size));
  blob.zstd.resize(size);
  return blob;
}

std::string unpack(std::string_view zstd, std::int64_t bytes, const Hash& sha256, const std::string& where) {
  const auto corrupt = [&](const std::string& what) {
    return Error(ErrorCode::kCorrupt, what, where, "make the file again, or take an undamaged copy");
  };
  if (bytes < 0 || bytes > kMostBytes)
    throw corrupt("a blob of " + std::to_string(bytes) + " bytes; 0 to " + std::to_string(kMostBytes) +
                  " are expected");
  if (bytes / kMostGrowth > static_cast<std::int64_t>(zstd.size()) ||
      ZSTD_getFrameContentSize(zstd.data(), zstd.size()) != static_cast<unsigned long long>(bytes))
    throw corrupt("a blob does not hold the " + std::to_string(bytes) + " bytes that it should");
  std::string plain(static_cast<std::size_t>(bytes), '\0');
  const std::size_t size = ZSTD_decompress(plain.data(), plain.size(), zstd.data(), zstd.size());
  if (ZSTD_isError(size)) throw corrupt(std::string("a blob cannot be decompressed: ") + ZSTD_getErrorName(size));
  if (size != plain.size() || hash_of_bytes(plain) != sha256) throw corrupt("a blob is not what its SHA-256 says");
  return plain;
}

}  // namespace mapweave::mapdb
