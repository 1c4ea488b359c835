#include "yaml_tree.h"

#include <yaml-cpp/eventhandler.h>
#include <yaml-cpp/exceptions.h>
#include <yaml-cpp/parser.h>

#include <algorithm>
#include <set>
#include <sstream>

namespace mapweave {
namespace {

constexpr std::size_t kMostLevels = 32;

class TreeBuilder final : public YAML::EventHandler {
 public:
  explicit TreeBuilder(const YamlErrorAt& error_at) : error_at_(error_at) {}
  YamlNode root;

  void OnDocumentStart(const YAML::Mark& mark) override {
    if (++documents_ > 1) throw error_at_(mark.line + 1, "a second document begins here", "put everything into one");
  }
  void OnDocumentEnd() override {}

  void OnNull(const YAML::Mark& mark, YAML::anchor_t anchor) override {
    add(made(YamlNode::Kind::null, mark, anchor, {}));
  }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t) override { refuse_anchor(mark.line + 1); }
  void OnScalar(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                const std::string& text) override {
    YamlNode node = made(YamlNode::Kind::scalar, mark, anchor, tag);
    node.text = text;
    node.is_quoted = tag == "!";
    add(std::move(node));
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                       YAML::EmitterStyle::value) override {
    open(made(YamlNode::Kind::list, mark, anchor, tag));
  }
  void OnSequenceEnd() override { close(); }
  void OnMapStart(const YAML::Mark& mark, const std::string& tag, YAML::anchor_t anchor,
                  YAML::EmitterStyle::value) override {
    open(made(YamlNode::Kind::map, mark, anchor, tag));
  }
  void OnMapEnd() override { close(); }

 private:
  struct Level {
    YamlNode node;
    std::set<std::string> keys_seen;
    bool awaits_key() const { return node.kind == YamlNode::Kind::map && node.keys.size() == node.items.size(); }
  };

  [[noreturn]] void refuse_anchor(int line) const {
    throw error_at_(line, "anchors and aliases ('&name', '*name') are not understood",
                    "write the values out, or quote a text that begins so");
  }

  YamlNode made(YamlNode::Kind kind, const YAML::Mark& mark, YAML::anchor_t anchor, const std::string& tag) const {
    YamlNode node;
    node.kind = kind;
    node.line = mark.line + 1;
    if (anchor != 0) refuse_anchor(node.line);
    if (!tag.empty() && tag != "?" && tag != "!") {
      throw error_at_(node.line, "tags ('" + shown_text(tag) + "') are not understood",
                      "leave it out, or quote a text that begins with '!'");
    }
    return node;
  }

  void open(YamlNode node) {
    if (levels_.size() >= kMostLevels) {
      throw error_at_(node.line, "sections and lists are nested more than " + std::to_string(kMostLevels) + " deep",
                      {});
    }
    if (!levels_.empty() && levels_.back().awaits_key()) refuse_key(node.line);
    levels_.push_back({std::move(node), {}});
  }

  void close() {
    YamlNode node = std::move(levels_.back().node);
    levels_.pop_back();
    add(std::move(node));
  }

  void add(YamlNode node) {
    if (levels_.empty()) {
      root = std::move(node);
    } else if (!levels_.back().awaits_key()) {
      levels_.back().node.items.push_back(std::move(node));
    } else {
      if (node.kind != YamlNode::Kind::scalar) refuse_key(node.line);
      auto& [map, keys_seen] = levels_.back();
      if (!keys_seen.insert(node.text).second) {
        const auto first = std::find(map.keys.begin(), map.keys.end(), node.text) - map.keys.begin();
        const int first_line = map.key_lines[static_cast<std::size_t>(first)];
        throw error_at_(node.line, "key '" + shown_text(node.text) + "' comes twice",
                        "it is on line " + std::to_string(first_line) + " already");
      }
      map.keys.push_back(std::move(node.text));
      map.key_lines.push_back(node.line);
    }
  }

  [[noreturn]] void refuse_key(int line) const {
    throw error_at_(line, "a key must be text", "look for a bracket that is not closed");
  }

  const YamlErrorAt& error_at_;
  std::vector<Level> levels_;
  int documents_ = 0;
};

}  // namespace

YamlNode parse_yaml(std::string_view bytes, const YamlErrorAt& error_at) {
  if (bytes.size() > kMostYamlBytes)
    throw error_at(0, "is larger than the " + std::to_string(kMostYamlBytes) + " bytes of a configuration", {});
  int line = 1;
  for (const char c : bytes) {
    const auto byte = static_cast<unsigned char>(c);
    if ((byte < 0x20 && c != '\n' && c != '\t' && c != '\r') || byte == 0x7F) {
      throw error_at(line, "byte " + std::to_string(byte) + " is not text", "a configuration is YAML in UTF-8");
    }
    line += c == '\n';
  }
  // yaml-cpp 0.7 takes a quote that is never closed for a text when the last byte is a line break.
  bytes = bytes.substr(0, bytes.find_last_not_of(" \t\r\n") + 1);
  TreeBuilder builder(error_at);
  try {
    std::istringstream stream{std::string(bytes)};
    YAML::Parser parser(stream);
    while (parser.HandleNextDocument(builder)) {}
  } catch (const Error&) {
    throw;
  } catch (const YAML::Exception& error) {
    throw error_at(error.mark.line + 1, "is not YAML: " + shown_text(error.msg), {});
  } catch (const std::exception& error) {
    throw error_at(0, "is not YAML: " + shown_text(error.what()), {});
  }
  return std::move(builder.root);
}

std::string shown_text(std::string_view text) {
  constexpr std::size_t kLongest = 60;
  std::size_t length = std::min(text.size(), kLongest);
  while (length < text.size() && length > 0 && (static_cast<unsigned char>(text[length]) & 0xC0) == 0x80) --length;
  std::string shown(text.substr(0, length));
  for (char& c : shown) {
    if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) c = '?';
  }
  return length < text.size() ? shown + "..." : shown;
}

}  // namespace mapweave
