#pragma once
// Content hashes (SHA-256): the identity of frozen content, of judgements and of files.

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>

namespace mapweave {

struct Hash {
  std::array<std::uint8_t, 32> bytes{};
  friend bool operator==(const Hash& a, const Hash& b) { return a.bytes == b.bytes; }
  friend bool operator!=(const Hash& a, const Hash& b) { return a.bytes != b.bytes; }
  friend bool operator<(const Hash& a, const Hash& b) { return a.bytes < b.bytes; }
};
std::string to_hex(const Hash&);
std::string to_hex(std::string_view bytes);  // two digits a byte, in lower case

// Adds values in a form that does not depend on the machine (little-endian, texts with their length), so that
// add("ab").add("c") and add("a").add("bc") differ.
class Hasher {
 public:
  Hasher();
  ~Hasher();
  Hasher(const Hasher&) = delete;
  Hasher& operator=(const Hasher&) = delete;
  Hasher& add(std::string_view text);
  Hasher& add(const Hash&);
  Hasher& add(double);
  Hasher& add(std::int64_t);
  Hasher& add_bytes(const void* data, std::size_t size);  // raw, no length
  Hash finish();                                          // once

 private:
  struct State;
  std::unique_ptr<State> state_;
};

Hash hash_of_bytes(std::string_view bytes);
Hash hash_of_file(const std::filesystem::path&);  // throws Error kMissing

}  // namespace mapweave
