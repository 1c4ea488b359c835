#pragma once
// manifest.json: what made a folder of results, of what, and the checksum of every file in it.

#include <mapweave/maps/map_identity.h>

#include <nlohmann/json_fwd.hpp>

#include <cstdint>
#include <filesystem>
#include <map>
#include <string>
#include <vector>

namespace mapweave::runtime {

std::string program_version();  // for example "0.1.0"

struct InputFile {
  std::string path;
  Hash sha256;
};

// Of a log: a file's bytes, or of a folder the names and bytes of its files, sorted. Throws Error kMissing.
Hash hash_of_input(const std::filesystem::path& log);

// Of the files below `folder` (manifest.json left out). Two runs on the same inputs give the same manifest but for
// "outputs_with_times": files that say how long things took. `maps`: by the paths of their stores.
nlohmann::ordered_json manifest_json(const std::string& verb, std::uint64_t seed, const std::vector<InputFile>& inputs,
                                     const std::filesystem::path& folder,
                                     const std::map<std::string, MapIdentity>& maps = {});

}  // namespace mapweave::runtime
