#include "unpacking.h"

#include "seekable_file.h"

#include <lz4frame.h>
#include <mapweave/core/error.h>
#include <mapweave/core/interrupt.h>
#include <zstd.h>

#include <algorithm>
#include <fstream>
#include <memory>

namespace mapweave::rawlog::ros {
namespace {

constexpr std::size_t kFirstBytes = std::size_t{1} << 16;
constexpr const char* kCopyAgain = "copy the recording again, or record again";

Error damage(const std::string& what, const std::string& where = {}) {
  return Error(ErrorCode::kCorrupt, what, where, kCopyAgain);
}

// Unpacks by `step(from, from_size, to, to_size)`, which sets both sizes to what was used and answers whether a frame
// ended.
template <class Step>
void unpack(std::string_view packed, std::size_t most, std::vector<char>& to, const char* name, Step&& step) {
  std::size_t used = 0;
  to.resize(std::min(most, std::max(kFirstBytes, to.capacity())));
  bool frame_ended = packed.empty();
  while (!packed.empty() || !frame_ended) {
    if (used == to.size() && used < most) to.resize(std::min(most, 2 * used));
    std::size_t from_size = packed.size(), to_size = to.size() - used;
    frame_ended = step(packed.data(), from_size, to.data() + used, to_size);
    packed.remove_prefix(from_size);
    used += to_size;
    if (frame_ended || from_size > 0 || to_size > 0) continue;
    if (used == most && used == to.size())
      throw damage("more than the " + std::to_string(most) + " bytes that it should hold are packed in the " + name);
    if (packed.empty()) throw damage(std::string("the ") + name + " ends early");
  }
  to.resize(used);
}

}  // namespace

void unpack_lz4(std::string_view packed, std::size_t most, std::vector<char>& to) {
  LZ4F_dctx* raw = nullptr;
  if (LZ4F_isError(LZ4F_createDecompressionContext(&raw, LZ4F_VERSION)))
    throw Error(ErrorCode::kInternal, "lz4 cannot start");
  const std::unique_ptr<LZ4F_dctx, LZ4F_errorCode_t (*)(LZ4F_dctx*)> context(raw, LZ4F_freeDecompressionContext);
  unpack(packed, most, to, "lz4", [&](const char* from, std::size_t& from_size, char* out, std::size_t& out_size) {
    const std::size_t answer = LZ4F_decompress(context.get(), out, &out_size, from, &from_size, nullptr);
    if (LZ4F_isError(answer)) throw damage(std::string("the lz4 is damaged: ") + LZ4F_getErrorName(answer));
    return answer == 0;
  });
}

void unpack_zstd(std::string_view packed, std::size_t most, std::vector<char>& to) {
  const std::unique_ptr<ZSTD_DCtx, std::size_t (*)(ZSTD_DCtx*)> context(ZSTD_createDCtx(), ZSTD_freeDCtx);
  unpack(packed, most, to, "zstd", [&](const char* from, std::size_t& from_size, char* out, std::size_t& out_size) {
    ZSTD_inBuffer input{from, from_size, 0};
    ZSTD_outBuffer output{out, out_size, 0};
    const std::size_t answer = ZSTD_decompressStream(context.get(), &output, &input);
    if (ZSTD_isError(answer)) throw damage(std::string("the zstd is damaged: ") + ZSTD_getErrorName(answer));
    from_size = input.pos;
    out_size = output.pos;
    return answer == 0;
  });
}

bool is_zstd(std::string_view bytes) { return bytes.substr(0, 4) == "\x28\xb5\x2f\xfd"; }

void unpack_zstd_file(const std::filesystem::path& from, const std::filesystem::path& to) {
  const SeekableFile file(from);
  std::ofstream unpacked(to, std::ios::binary | std::ios::trunc);
  const std::unique_ptr<ZSTD_DCtx, std::size_t (*)(ZSTD_DCtx*)> context(ZSTD_createDCtx(), ZSTD_freeDCtx);
  std::vector<char> packed(ZSTD_DStreamInSize()), plain(ZSTD_DStreamOutSize());
  bool frame_ended = false;
  for (std::uint64_t offset = 0; offset < file.bytes();) {
    throw_if_interrupted();
    const auto some = static_cast<std::size_t>(std::min<std::uint64_t>(packed.size(), file.bytes() - offset));
    if (!file.read_at(offset, packed.data(), some)) throw damage("became shorter while it was read", from.string());
    ZSTD_inBuffer input{packed.data(), some, 0};
    for (bool is_full = true; input.pos < input.size || is_full;) {
      ZSTD_outBuffer output{plain.data(), plain.size(), 0};
      const std::size_t answer = ZSTD_decompressStream(context.get(), &output, &input);
      if (ZSTD_isError(answer))
        throw damage(std::string("the zstd is damaged: ") + ZSTD_getErrorName(answer), file.place(offset + input.pos));
      frame_ended = answer == 0;
      unpacked.write(plain.data(), static_cast<std::streamsize>(output.pos));
      is_full = !frame_ended && output.pos == output.size;
    }
    offset += some;
  }
  unpacked.close();
  if (!unpacked)
    throw Error(ErrorCode::kCannotWrite, "what " + from.string() + " holds cannot be unpacked there", to.string(),
                "free some space, or name another folder in TMPDIR");
  if (!frame_ended) throw damage("the zstd ends early", from.string());
}

}  // namespace mapweave::rawlog::ros
