#include "zstd_file.h"

#include "chunk_unpacking.h"
#include "seekable_file.h"

#include <mapweave/core/error.h>
#include <mapweave/core/interrupt.h>
#include <zstd.h>

#include <algorithm>
#include <fstream>
#include <memory>
#include <string>
#include <vector>

namespace mapweave::rawlog::ros {
namespace {

Error damage(const std::string& what, const std::string& where) {
  return Error(ErrorCode::kCorrupt, what, where, "copy the recording again, or record again");
}

}  // namespace

void unpack_message(std::string_view data, std::uint64_t most_bytes, std::vector<std::byte>& to) {
  UnpackedChunk unpacked;
  if (data.substr(0, 4) == "\x28\xb5\x2f\xfd") {
    unpacked = unpack_zstd(data, static_cast<std::size_t>(most_bytes));
    if (!unpacked.problem.empty())
      throw Error(ErrorCode::kCorrupt, "the message cannot be unpacked: " + unpacked.problem, {},
                  "copy the recording again, or map what precedes this with --keep-going");
    data = unpacked.bytes;
  }
  const auto* bytes = reinterpret_cast<const std::byte*>(data.data());
  to.assign(bytes, bytes + data.size());
}

std::optional<Error> unpack_zstd_file(const std::filesystem::path& from, const std::filesystem::path& to) {
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
  if (frame_ended) return std::nullopt;
  return Error(ErrorCode::kCorrupt, "the zstd is cut short: it ends within a frame", file.place(file.bytes()),
               "copy the recording again, or map what precedes this with --keep-going");
}

}  // namespace mapweave::rawlog::ros
