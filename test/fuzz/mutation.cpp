#include "mutation.h"

#include <algorithm>
#include <cstdint>
#include <cstring>

namespace mapweave::fuzz {
namespace {

constexpr std::uint64_t kNumbers[] = {0,          1,          0x7f,       0x80,       0xff,
                                      0x100,      0x7fff,     0xffff,     0x10000,    0x7fffffff,
                                      0x80000000, 0xffffffff, 0x7ff00000, 0x7ff80000, 0x7fffffffffffffff};
constexpr std::size_t kLongestPiece = 64;

std::size_t below(std::size_t count, std::mt19937_64& random) { return random() % std::max<std::size_t>(count, 1); }

std::size_t length_at(const std::string& bytes, std::size_t at, std::mt19937_64& random) {
  return std::min(bytes.size() - at, 1 + below(kLongestPiece, random));
}

void write_number(std::string& bytes, std::size_t at, std::mt19937_64& random) {
  const std::uint64_t number = kNumbers[below(std::size(kNumbers), random)];
  const std::size_t size = std::min<std::size_t>(std::size_t{1} << below(4, random), bytes.size() - at);
  std::memcpy(bytes.data() + at, &number, size);
}

void write_text(std::string& bytes, std::size_t at, std::mt19937_64& random) {
  static const char* const kTexts[] = {"0",     "-1",  "9",   "999999999999999999999",
                                       "1e308", "nan", "inf", "-",
                                       "\"",    "[",   "{",   "}",
                                       ": ",    "\n",  "\t",  "null",
                                       "../",   "#\n", ",",   "1e-320"};
  bytes.replace(at, below(4, random), kTexts[below(std::size(kTexts), random)]);
}

void change(std::string& bytes, const std::vector<std::string>& seeds, std::mt19937_64& random) {
  if (bytes.empty()) bytes.push_back(static_cast<char>(random()));
  const std::size_t at = below(bytes.size(), random);
  switch (random() % 9) {
    case 0: bytes[at] = static_cast<char>(bytes[at] ^ (1 << random() % 8)); break;
    case 1: bytes[at] = static_cast<char>(random()); break;
    case 2: write_number(bytes, at, random); break;
    case 3: write_text(bytes, at, random); break;
    case 4: bytes.erase(at, length_at(bytes, at, random)); break;
    case 5: bytes.insert(at, bytes.substr(at, length_at(bytes, at, random))); break;
    case 6: {
      const std::string& other = seeds[below(seeds.size(), random)];
      const std::size_t from = below(other.size(), random);
      bytes.insert(at, other.substr(from, length_at(other, from, random)));
      break;
    }
    case 7: bytes.insert(at, 1 + below(kLongestPiece, random), static_cast<char>(random())); break;
    default:
      if (random() % 4 == 0) bytes.resize(at);
  }
}

}  // namespace

std::string mutated(const std::vector<std::string>& seeds, std::mt19937_64& random) {
  std::string bytes = seeds[below(seeds.size(), random)];
  for (std::size_t changes = 1 + below(8, random); changes > 0; --changes) change(bytes, seeds, random);
  return bytes;
}

}  // namespace mapweave::fuzz
