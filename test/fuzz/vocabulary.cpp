// Vocabularies of visual words, as text and as .gz.

#include "fuzz_target.h"

#include <mapweave/matching/binary_vocabulary.h>

#include <zlib.h>

namespace mapweave::fuzz {
namespace {

// Two levels of two branches: descriptors of 32 numbers.
std::string small_vocabulary() {
  std::string text = "2 2 0 0\n";
  const auto node = [&](int parent, bool is_word, int shade, const char* weight) {
    text += std::to_string(parent) + (is_word ? " 1" : " 0");
    for (int i = 0; i < 32; ++i) text += " " + std::to_string(shade);
    text += std::string(" ") + weight + "\n";
  };
  node(0, false, 0, "0");
  node(0, false, 255, "0");
  for (const int parent : {1, 2})
    for (const int shade : {1, 200}) node(parent, true, shade, "1.25");
  return text;
}

std::string packed(const std::string& text) {
  const auto path = scratch_folder() / "packed.gz";
  gzFile file = gzopen(path.c_str(), "wb");
  expect(file != nullptr && gzwrite(file, text.data(), static_cast<unsigned>(text.size())) > 0, "a file of gz");
  gzclose(file);
  return file_bytes(path);
}

}  // namespace

std::vector<std::string> seeds() { return {small_vocabulary(), packed(small_vocabulary())}; }

void decode(std::string_view bytes) { matching::parse_vocabulary(bytes, kWhere); }

}  // namespace mapweave::fuzz
