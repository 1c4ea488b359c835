#pragma once
// What a coordinator reads of what programs say of themselves (program_status), and what edges say of maps.

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <vector>

namespace mapweave::runtime {

struct ProgramWord {
  struct Link {
    std::string name;
    double scans = 0.0, queue_bytes = 0.0;
    std::optional<double> bytes_per_s;  // as measured
  };
  std::int64_t said_at_ns = 0;
  bool is_done = false, is_sealing = false;
  std::uint64_t plan = 0;
  double scans = 0.0, mapping_s = 0.0;  // counts of the tier; 0 where it has none
  std::vector<Link> links;
  std::set<std::string> ended;  // robots whose maps an edge has finished
};

// Of the program's first tier. Throws Error: kCorrupt for what is not JSON, kBadInput for what is no such word.
ProgramWord decode_program_word(std::string_view json, const std::string& where);

// Several messages as one; those that do not fit into `most_bytes` are left out. unpacked() throws Error(kCorrupt).
std::string packed(const std::vector<std::string>& messages, std::size_t most_bytes);
std::vector<std::string> unpacked(std::string_view bytes, const std::string& where);

}  // namespace mapweave::runtime
