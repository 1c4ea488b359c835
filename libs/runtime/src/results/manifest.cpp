#include <mapweave/core/error.h>
#include <mapweave/runtime/manifest.h>

#include <nlohmann/json.hpp>

#include <map>

namespace mapweave::runtime {

namespace {

constexpr int kDeepest = 4;  // folders within a recording; links may lead in circles

}  // namespace

std::string program_version() { return MAPWEAVE_VERSION; }

Hash hash_of_input(const std::filesystem::path& log) {
  std::error_code problem;
  if (!std::filesystem::is_directory(log, problem)) return hash_of_file(log);
  std::map<std::string, Hash> files;
  std::filesystem::recursive_directory_iterator entry(log, std::filesystem::directory_options::follow_directory_symlink,
                                                      problem);
  for (; !problem && entry != std::filesystem::recursive_directory_iterator(); entry.increment(problem)) {
    if (entry.depth() >= kDeepest) entry.disable_recursion_pending();
    std::error_code ignored;
    if (entry->is_regular_file(ignored))
      files[entry->path().lexically_relative(log).generic_string()] = hash_of_file(entry->path());
  }
  if (problem)
    throw Error(ErrorCode::kMissing, "the folder cannot be read: " + problem.message(), log.string(),
                "check its permissions");
  Hasher hasher;
  for (const auto& [name, hash] : files) hasher.add(name).add(hash);
  return hasher.finish();
}

nlohmann::ordered_json manifest_json(const std::string& verb, std::uint64_t seed, const std::vector<InputFile>& inputs,
                                     const std::filesystem::path& folder,
                                     const std::map<std::string, MapIdentity>& maps) {
  using Json = nlohmann::ordered_json;
  std::map<std::string, std::string> checksums;  // by path within the folder
  for (const auto& entry : std::filesystem::recursive_directory_iterator(folder))
    if (entry.is_regular_file())
      checksums[entry.path().lexically_relative(folder).generic_string()] = to_hex(hash_of_file(entry.path()));
  checksums.erase("manifest.json");

  Json input_list = Json::array(), outputs = Json::object(), outputs_with_times = Json::object();
  for (const InputFile& input : inputs) input_list.push_back({{"path", input.path}, {"sha256", to_hex(input.sha256)}});
  for (const auto& [path, checksum] : checksums)
    (path == "summary.json" || path == "merges.json" || path == "rounds.json" ? outputs_with_times : outputs)[path] =
        checksum;
  Json map_list = Json::object();
  for (const auto& [path, identity] : maps)
    map_list[path] = {{"map_id", identity.id},
                      {"map_version", std::to_string(identity.version)},
                      {"content_hash", to_hex(identity.content)}};
  return {{"program", "mapweave"},
          {"verb", verb},
          {"versions", Json::parse(MAPWEAVE_VERSIONS)},
          {"seed", seed},
          {"inputs", input_list},
          {"maps", map_list},
          {"outputs", outputs},
          {"outputs_with_times", outputs_with_times}};
}

}  // namespace mapweave::runtime
