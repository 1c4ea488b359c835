#include "fuzz_target.h"

#include <mapweave/core/files.h>
#include <support/temporary_folder.h>

#include <cstdio>
#include <cstdlib>
#include <fstream>

namespace mapweave::fuzz {

namespace fs = std::filesystem;

void expect(bool holds, const std::string& what) {
  if (holds) return;
  std::fprintf(stderr, "expected: %s\n", what.c_str());
  std::abort();
}

void expect_decoded_or_refused(std::string_view bytes) {
  try {
    decode(bytes);
  } catch (const Error& error) {
    expect(error.code() != ErrorCode::kInternal, std::string("a fault of the input: ") + error.what());
    expect(!error.where().empty(), std::string("an error that says where: ") + error.what());
  }
}

std::vector<std::string> seeds_of(const std::vector<Kind>& kinds) {
  std::vector<std::string> seeds;
  for (std::size_t i = 0; i < kinds.size(); ++i)
    for (const std::string& seed : kinds[i].seeds) seeds.push_back(static_cast<char>(i) + seed);
  return seeds;
}

void decode_one_of(const std::vector<Kind>& kinds, std::string_view bytes) {
  if (bytes.empty()) return;
  kinds[static_cast<unsigned char>(bytes.front()) % kinds.size()].decode(bytes.substr(1));
}

const fs::path& scratch_folder() {
  static const test::TemporaryFolder folder;
  return folder.path();
}

fs::path scratch_file(const std::string& name, std::string_view bytes) {
  const fs::path path = scratch_folder() / name;
  fs::create_directories(path.parent_path());
  fs::remove(path);  // ext4 syncs a file that was truncated, not a new one
  std::ofstream file(path, std::ios::binary);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  expect(static_cast<bool>(file.flush()), "room in " + path.string());
  return path;
}

void clear_scratch() {
  for (const auto& entry : fs::directory_iterator(scratch_folder())) fs::remove_all(entry.path());
}

std::string file_bytes(const fs::path& path) { return read_file(path); }

}  // namespace mapweave::fuzz
