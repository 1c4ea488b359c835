#include "chunk_unpacking.h"

#include <mapweave/core/error.h>

#include <bzlib.h>
#include <lz4frame.h>
#include <zstd.h>

#include <algorithm>
#include <memory>

namespace mapweave::rawlog::ros {
namespace {

constexpr std::size_t kStep_bytes = std::size_t{1} << 20;
constexpr const char* kTooLarge = "it unpacks to more than its size says";
constexpr const char* kCutShort = "it is cut short";

// Room for more behind `used` bytes; false where that would be more than may come.
bool make_room(std::string& bytes, std::size_t used, std::size_t most_bytes) {
  if (used < bytes.size()) return true;
  if (used == most_bytes) return false;
  bytes.resize(std::min(most_bytes, std::max(2 * used, kStep_bytes)));
  return true;
}

struct Bz2Stream {
  bz_stream state{};
  Bz2Stream() {
    if (::BZ2_bzDecompressInit(&state, 0, 0) != BZ_OK) throw Error(ErrorCode::kInternal, "bzip2 cannot start");
  }
  Bz2Stream(const Bz2Stream&) = delete;
  Bz2Stream& operator=(const Bz2Stream&) = delete;
  ~Bz2Stream() { ::BZ2_bzDecompressEnd(&state); }
};

// Making one takes as long as unpacking a small message.
ZSTD_DCtx& zstd_context() {
  thread_local const std::unique_ptr<ZSTD_DCtx, std::size_t (*)(ZSTD_DCtx*)> context(::ZSTD_createDCtx(),
                                                                                     ::ZSTD_freeDCtx);
  if (!context) throw Error(ErrorCode::kInternal, "zstd cannot start");
  ::ZSTD_DCtx_reset(context.get(), ZSTD_reset_session_only);
  return *context;
}

}  // namespace

UnpackedChunk unpack_bz2(std::string_view packed, std::size_t most_bytes) {
  UnpackedChunk chunk;
  Bz2Stream stream;
  stream.state.next_in = const_cast<char*>(packed.data());
  stream.state.avail_in = static_cast<unsigned>(packed.size());
  std::size_t used = 0;
  char beyond = 0;  // takes what is too much
  for (int answer = BZ_OK; answer != BZ_STREAM_END;) {
    const bool has_room = make_room(chunk.bytes, used, most_bytes);
    const auto room = has_room ? std::min<std::size_t>(chunk.bytes.size() - used, std::size_t{1} << 30) : 1;
    stream.state.next_out = has_room ? chunk.bytes.data() + used : &beyond;
    stream.state.avail_out = static_cast<unsigned>(room);
    const unsigned before = stream.state.avail_in;
    answer = ::BZ2_bzDecompress(&stream.state);
    const std::size_t got = room - stream.state.avail_out;
    if (!has_room && got > 0) chunk.problem = kTooLarge;
    if (has_room) used += got;
    if (answer != BZ_OK && answer != BZ_STREAM_END) chunk.problem = "its bzip2 stream is damaged";
    if (answer == BZ_OK && got == 0 && stream.state.avail_in == before) chunk.problem = kCutShort;
    if (!chunk.problem.empty()) break;
  }
  chunk.bytes.resize(used);
  return chunk;
}

UnpackedChunk unpack_lz4(std::string_view packed, std::size_t most_bytes) {
  UnpackedChunk chunk;
  LZ4F_dctx* made = nullptr;
  if (LZ4F_isError(::LZ4F_createDecompressionContext(&made, LZ4F_VERSION)) != 0U)
    throw Error(ErrorCode::kInternal, "LZ4 cannot start");
  const std::unique_ptr<LZ4F_dctx, LZ4F_errorCode_t (*)(LZ4F_dctx*)> stream(made, ::LZ4F_freeDecompressionContext);
  std::size_t used = 0, taken = 0, expected = 1;
  char beyond = 0;
  while (expected != 0 || taken < packed.size()) {
    const bool has_room = make_room(chunk.bytes, used, most_bytes);
    std::size_t room = has_room ? chunk.bytes.size() - used : 1, some = packed.size() - taken;
    expected = ::LZ4F_decompress(stream.get(), has_room ? chunk.bytes.data() + used : &beyond, &room,
                                 packed.data() + taken, &some, nullptr);
    if (LZ4F_isError(expected) != 0U)
      chunk.problem = std::string("its LZ4 stream is damaged (") + ::LZ4F_getErrorName(expected) + ")";
    else if (!has_room && room > 0)
      chunk.problem = kTooLarge;
    else if (room == 0 && some == 0 && expected != 0)
      chunk.problem = kCutShort;
    if (has_room && LZ4F_isError(expected) == 0U) used += room;
    taken += some;
    if (!chunk.problem.empty()) break;
  }
  chunk.bytes.resize(used);
  return chunk;
}

UnpackedChunk unpack_zstd(std::string_view packed, std::size_t most_bytes) {
  UnpackedChunk chunk;
  ZSTD_DCtx& stream = zstd_context();
  ZSTD_inBuffer input{packed.data(), packed.size(), 0};
  // A small message needs no more room than its frame says.
  if (const auto claimed = ::ZSTD_getFrameContentSize(packed.data(), packed.size()); claimed < kStep_bytes)
    chunk.bytes.resize(std::min(most_bytes, static_cast<std::size_t>(claimed)));
  std::size_t used = 0, expected = 1;
  char beyond = 0;
  while (expected != 0 || input.pos < input.size) {
    const bool has_room = make_room(chunk.bytes, used, most_bytes);
    ZSTD_outBuffer output{has_room ? chunk.bytes.data() + used : &beyond, has_room ? chunk.bytes.size() - used : 1, 0};
    const std::size_t before = input.pos;
    expected = ::ZSTD_decompressStream(&stream, &output, &input);
    if (ZSTD_isError(expected) != 0U)
      chunk.problem = std::string("its zstd stream is damaged (") + ::ZSTD_getErrorName(expected) + ")";
    else if (!has_room && output.pos > 0)
      chunk.problem = kTooLarge;
    else if (output.pos == 0 && input.pos == before && expected != 0)
      chunk.problem = kCutShort;
    if (has_room && ZSTD_isError(expected) == 0U) used += output.pos;
    if (!chunk.problem.empty()) break;
  }
  chunk.bytes.resize(used);
  return chunk;
}

}  // namespace mapweave::rawlog::ros
