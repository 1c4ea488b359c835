// A target as a program of libFuzzer: its own options, and "--write-seeds FOLDER".

#include "fuzz_target.h"

#include <mapweave/core/log.h>

#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <fstream>

namespace {

void write_seeds(const std::filesystem::path& folder) {
  std::filesystem::create_directories(folder);
  std::size_t number = 0;
  for (const std::string& seed : mapweave::fuzz::seeds()) {
    std::ofstream file(folder / ("seed-" + std::to_string(number++)), std::ios::binary);
    file.write(seed.data(), static_cast<std::streamsize>(seed.size()));
    mapweave::fuzz::expect(static_cast<bool>(file.flush()), "room in " + folder.string());
  }
  std::printf("%zu seeds\n", number);
}

}  // namespace

extern "C" int LLVMFuzzerInitialize(int* argc, char*** argv) {
  mapweave::set_log_level(mapweave::LogLevel::error);  // warnings of what is read thousands of times
  if (*argc == 3 && std::string_view((*argv)[1]) == "--write-seeds") {
    write_seeds((*argv)[2]);
    std::exit(0);
  }
  return 0;
}

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  mapweave::fuzz::expect_decoded_or_refused({reinterpret_cast<const char*>(data), size});
  return 0;
}
