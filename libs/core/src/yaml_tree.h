#pragma once
// YAML from strangers, as far as a configuration needs it: plain trees. Anchors, aliases, tags, second documents, keys
// that are no text or come twice, control characters, more than 1 MB or 32 levels are refused.

#include <mapweave/core/error.h>

#include <functional>
#include <string>
#include <string_view>
#include <vector>

namespace mapweave {

constexpr std::size_t kMostYamlBytes = 1 << 20;

struct YamlNode {
  enum class Kind { null, scalar, list, map };
  Kind kind = Kind::null;
  int line = 0;      // from 1; 0: unknown
  std::string text;  // of a scalar
  bool is_quoted = false;
  std::vector<std::string> keys;  // of a map, one for each item
  std::vector<int> key_lines;
  std::vector<YamlNode> items;  // of a list or map
};

// Makes the Error of a problem on a line (0: unknown).
using YamlErrorAt = std::function<Error(int line, std::string problem, std::string remedy)>;

// An empty text is a null node.
YamlNode parse_yaml(std::string_view bytes, const YamlErrorAt& error_at);

// For messages: cut to a line's length, without control characters.
std::string shown_text(std::string_view text);

}  // namespace mapweave
