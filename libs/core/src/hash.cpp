#include <mapweave/core/error.h>
#include <mapweave/core/hash.h>
#include <openssl/evp.h>

#include <cstring>
#include <fstream>
#include <vector>

namespace mapweave {
namespace {

std::array<std::uint8_t, 8> little_endian(std::uint64_t value) {
  std::array<std::uint8_t, 8> bytes;
  for (std::size_t i = 0; i < bytes.size(); ++i) bytes[i] = static_cast<std::uint8_t>(value >> (8 * i));
  return bytes;
}

void expect_success(int result) {
  if (result != 1) throw Error(ErrorCode::kInternal, "OpenSSL cannot compute a SHA-256");
}

}  // namespace

std::string to_hex(std::string_view bytes) {
  constexpr char kDigits[] = "0123456789abcdef";
  std::string text;
  text.reserve(2 * bytes.size());
  for (const char letter : bytes) {
    const auto byte = static_cast<unsigned char>(letter);
    text += kDigits[byte >> 4];
    text += kDigits[byte & 15];
  }
  return text;
}

std::string to_hex(const Hash& hash) {
  return to_hex(std::string_view(reinterpret_cast<const char*>(hash.bytes.data()), hash.bytes.size()));
}

struct Hasher::State {
  std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> context{EVP_MD_CTX_new(), &EVP_MD_CTX_free};
  bool finished = false;
};

Hasher::Hasher() : state_(std::make_unique<State>()) {
  expect_success(state_->context ? EVP_DigestInit_ex(state_->context.get(), EVP_sha256(), nullptr) : 0);
}
Hasher::~Hasher() = default;

Hasher& Hasher::add_bytes(const void* data, std::size_t size) {
  MAPWEAVE_EXPECT(!state_->finished, "a finished hasher takes no more");
  if (size > 0) expect_success(EVP_DigestUpdate(state_->context.get(), data, size));
  return *this;
}

Hasher& Hasher::add(std::string_view text) {
  add(static_cast<std::int64_t>(text.size()));
  return add_bytes(text.data(), text.size());
}

Hasher& Hasher::add(const Hash& hash) { return add_bytes(hash.bytes.data(), hash.bytes.size()); }

Hasher& Hasher::add(double value) {
  std::uint64_t bits;
  static_assert(sizeof bits == sizeof value);
  std::memcpy(&bits, &value, sizeof bits);
  const auto bytes = little_endian(bits);
  return add_bytes(bytes.data(), bytes.size());
}

Hasher& Hasher::add(std::int64_t value) {
  const auto bytes = little_endian(static_cast<std::uint64_t>(value));
  return add_bytes(bytes.data(), bytes.size());
}

Hash Hasher::finish() {
  MAPWEAVE_EXPECT(!state_->finished, "a hasher finishes once");
  state_->finished = true;
  Hash hash;
  expect_success(EVP_DigestFinal_ex(state_->context.get(), hash.bytes.data(), nullptr));
  return hash;
}

Hash hash_of_bytes(std::string_view bytes) { return Hasher().add_bytes(bytes.data(), bytes.size()).finish(); }

Hash hash_of_file(const std::filesystem::path& path) {
  std::error_code ignored;
  std::ifstream file(path, std::ios::binary);
  if (!file || std::filesystem::is_directory(path, ignored)) {
    throw Error(ErrorCode::kMissing, "cannot be read as a file", path.string(), "check the path");
  }
  Hasher hasher;
  std::vector<char> block(1 << 18);
  while (file) {
    file.read(block.data(), static_cast<std::streamsize>(block.size()));
    hasher.add_bytes(block.data(), static_cast<std::size_t>(file.gcount()));
  }
  if (file.bad()) throw Error(ErrorCode::kMissing, "reading stopped before the end of the file", path.string());
  return hasher.finish();
}

}  // namespace mapweave
