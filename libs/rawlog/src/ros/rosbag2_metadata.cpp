#include "rosbag2_metadata.h"

#include "mcap_records.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/core/log.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <cctype>
#include <string_view>

namespace mapweave::rawlog::ros {
namespace {

namespace fs = std::filesystem;

constexpr const char* kFile = "metadata.yaml";
constexpr const char* kRoot = "rosbag2_bagfile_information";
constexpr std::uint64_t kMostYamlBytes = std::uint64_t{1} << 24;
constexpr const char* kRemedy = "correct it, or take it away: then the parts in the folder are read by their names";

bool ends_with(std::string_view text, std::string_view end) {
  return text.size() >= end.size() && text.substr(text.size() - end.size()) == end;
}

bool is_part(const std::string& name) {
  return ends_with(name, ".db3") || ends_with(name, ".mcap") || ends_with(name, ".db3.zstd") ||
         ends_with(name, ".mcap.zstd");
}

// "a_10" after "a_9".
bool is_before(std::string_view a, std::string_view b) {
  const auto is_digit = [](char letter) { return std::isdigit(static_cast<unsigned char>(letter)) != 0; };
  const auto take_number = [&](std::string_view& text) {
    const auto end = std::find_if_not(text.begin(), text.end(), is_digit);
    auto digits = text.substr(0, static_cast<std::size_t>(end - text.begin()));
    text.remove_prefix(digits.size());
    digits.remove_prefix(std::min(digits.find_first_not_of('0'), digits.size()));
    return digits;
  };
  while (!a.empty() && !b.empty()) {
    if (is_digit(a.front()) && is_digit(b.front())) {
      const auto first = take_number(a), second = take_number(b);
      if (first.size() != second.size()) return first.size() < second.size();
      if (first != second) return first < second;
    } else {
      if (a.front() != b.front()) return a.front() < b.front();
      a.remove_prefix(1);
      b.remove_prefix(1);
    }
  }
  return a.size() < b.size();
}

Error misfit(const fs::path& file, const std::string& what) {
  return Error(ErrorCode::kBadInput, what, file.string(), kRemedy);
}

std::string text_at(const YAML::Node& node, const char* key) {
  return node[key] ? node[key].as<std::string>() : std::string();
}

std::vector<BagTopic> topics_of(const YAML::Node& bag) {
  std::vector<BagTopic> topics;
  for (const YAML::Node& entry : bag["topics_with_message_count"]) {
    const YAML::Node about = entry["topic_metadata"];
    if (!about || text_at(about, "serialization_format") != "cdr") continue;
    BagTopic topic;
    topic.name = about["name"].as<std::string>();
    topic.type = type_without_msg(about["type"].as<std::string>());
    topic.encoding = MessageEncoding::cdr;
    topic.messages = entry["message_count"].as<std::uint64_t>(0);
    topics.push_back(std::move(topic));
  }
  return topics;
}

void expect_known(const YAML::Node& bag, const fs::path& file) {
  const std::string storage = text_at(bag, "storage_identifier");
  if (storage != "sqlite3" && storage != "mcap")
    throw Error(ErrorCode::kUnsupported, "storage_identifier is '" + storage + "'; sqlite3 and mcap are read",
                file.string(), "convert the recording: ros2 bag convert");
  const std::string compression = text_at(bag, "compression_format"), mode = text_at(bag, "compression_mode");
  if (!compression.empty() && compression != "zstd" && mode != "" && mode != "NONE" && mode != "none")
    throw Error(ErrorCode::kUnsupported, "compression_format is '" + compression + "'; zstd is read", file.string(),
                "convert the recording: ros2 bag convert");
}

// The parts lie beside the file, whatever folders it names: early versions wrote the recording's own name before each.
fs::path part_of(const fs::path& folder, const std::string& listed) {
  const fs::path part = folder / fs::path(listed).filename();
  std::error_code ignored;
  if (fs::is_regular_file(part, ignored)) return part;
  const fs::path packed = part.string() + ".zstd";
  if (fs::is_regular_file(packed, ignored)) return packed;
  const fs::path plain = fs::path(part).replace_extension();
  if (part.extension() == ".zstd" && fs::is_regular_file(plain, ignored)) return plain;
  throw Error(
      ErrorCode::kMissing,
      "part '" + fs::path(listed).filename().string() + "' of the recording is missing (" + kFile + " lists it)",
      folder.string(), "copy it there, or take it out of relative_file_paths to read the recording without it");
}

}  // namespace

bool has_rosbag2_metadata(const fs::path& folder) {
  std::error_code ignored;
  if (!fs::is_regular_file(folder / kFile, ignored)) return false;
  try {
    return read_file(folder / kFile, kMostYamlBytes).find(kRoot) != std::string::npos;
  } catch (const Error&) {
    return false;
  }
}

std::vector<fs::path> parts_in(const fs::path& folder) {
  std::vector<fs::path> parts;
  std::error_code ignored;
  for (const auto& entry : fs::directory_iterator(folder, ignored))
    if (entry.is_regular_file(ignored) && is_part(entry.path().filename().string())) parts.push_back(entry.path());
  std::sort(parts.begin(), parts.end(), [](const fs::path& a, const fs::path& b) {
    return is_before(a.filename().string(), b.filename().string());
  });
  return parts;
}

Rosbag2Metadata read_rosbag2_metadata(const fs::path& folder) {
  Rosbag2Metadata metadata;
  const fs::path file = folder / kFile;
  if (std::error_code ignored; !fs::is_regular_file(file, ignored)) {
    metadata.parts = parts_in(folder);
    if (metadata.parts.empty())
      throw Error(ErrorCode::kMissing, "holds neither metadata.yaml nor parts of a recording (.db3, .mcap)",
                  folder.string(), "name the folder that ros2 bag record made");
    log(LogLevel::warning, folder.string() + ": metadata.yaml is missing (was the recorder killed?); its " +
                               std::to_string(metadata.parts.size()) + " parts are read in the order of their names");
    return metadata;
  }
  try {
    const YAML::Node bag = YAML::Load(read_file(file, kMostYamlBytes))[kRoot];
    if (!bag || !bag.IsMap()) throw misfit(file, std::string("lacks ") + kRoot);
    expect_known(bag, file);
    metadata.storage = text_at(bag, "storage_identifier");
    const YAML::Node paths = bag["relative_file_paths"];
    if (!paths || !paths.IsSequence() || paths.size() == 0) throw misfit(file, "lists no parts (relative_file_paths)");
    for (const YAML::Node& path : paths) metadata.parts.push_back(part_of(folder, path.as<std::string>()));
    metadata.topics = topics_of(bag);
  } catch (const YAML::Exception& error) {
    throw misfit(fs::path(file.string() + ":" + std::to_string(error.mark.line + 1)), "cannot be read: " + error.msg);
  }
  return metadata;
}

}  // namespace mapweave::rawlog::ros
