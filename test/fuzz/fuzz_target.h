#pragma once
// What every fuzz target is made of. A target is a source file that defines seeds() and decode(); libfuzzer_main.cpp or
// replay_main.cpp makes a program of it (README.md).

#include <mapweave/core/error.h>

#include <filesystem>
#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace mapweave::fuzz {

// Defined by the target. Sound inputs, made by code or of test/data, of which hostile ones are made; small.
std::vector<std::string> seeds();
// Defined by the target. Reads `bytes` as the project would. An Error is a fine answer where it says where; anything
// else that leaves it is a bug.
void decode(std::string_view bytes);

// As decode(), and ends the process (abort) for an Error that does not say where, or that is the program's own.
void expect_decoded_or_refused(std::string_view bytes);
// Ends the process (abort) and says why, unless it holds.
void expect(bool holds, const std::string& what);

// A decoder among several of one target: an input's first byte says which one reads the rest.
struct Kind {
  std::function<void(std::string_view)> decode;
  std::vector<std::string> seeds;
};
std::vector<std::string> seeds_of(const std::vector<Kind>& kinds);
void decode_one_of(const std::vector<Kind>& kinds, std::string_view bytes);

// Where a decoder says that its bytes come from.
inline constexpr char kWhere[] = "fuzzed";

// Of decode(bytes, where) and encode(): what was read has a byte form, and that is read as the same.
template <class Decode>
std::function<void(std::string_view)> round_trip(Decode decode) {
  return [decode](std::string_view bytes) {
    const auto read = decode(bytes, kWhere);
    const std::string written = encode(read);
    try {
      expect(encode(decode(written, kWhere)) == written, "what was read comes back as it was");
    } catch (const Error& error) {
      expect(false, std::string("what was read can be read again: ") + error.what());
    }
  };
}

// A folder for decoders that read files: new, and removed at the end. In memory where TMPDIR says so.
const std::filesystem::path& scratch_folder();
// Writes a file there (beside what is there already) and answers its path.
std::filesystem::path scratch_file(const std::string& name, std::string_view bytes);
// Removes all that is there.
void clear_scratch();
std::string file_bytes(const std::filesystem::path& path);

}  // namespace mapweave::fuzz
