#include <mapweave/runtime/manifest.h>

#include <nlohmann/json.hpp>

#include <map>

namespace mapweave::runtime {

std::string program_version() { return MAPWEAVE_VERSION; }

nlohmann::ordered_json manifest_json(const std::string& verb, std::uint64_t seed, const std::vector<InputFile>& inputs,
                                     const std::filesystem::path& folder) {
  using Json = nlohmann::ordered_json;
  std::map<std::string, std::string> checksums;  // by path within the folder
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder))
    if (entry.is_regular_file()) checksums[entry.path().lexically_relative(folder).generic_string()] = to_hex(hash_of_file(entry.path()));
  checksums.erase("manifest.json");

  Json input_list = Json::array(), outputs = Json::object(), outputs_with_times = Json::object();
  for (const InputFile& input : inputs) input_list.push_back({{"path", input.path}, {"sha256", to_hex(input.sha256)}});
  for (const auto& [path, checksum] : checksums)
    (path == "summary.json" || path == "merges.json" ? outputs_with_times : outputs)[path] = checksum;
  return {{"program", "mapweave"}, {"verb", verb},       {"versions", Json::parse(MAPWEAVE_VERSIONS)}, {"seed", seed},
          {"inputs", input_list},  {"outputs", outputs}, {"outputs_with_times", outputs_with_times}};
}

}  // namespace mapweave::runtime
