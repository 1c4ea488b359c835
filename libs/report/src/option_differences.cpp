#include "option_differences.h"

#include <mapweave/core/error.h>

#include <yaml-cpp/yaml.h>

#include <map>
#include <vector>

namespace mapweave::report {
namespace {

struct OptionValue {
  std::string name, value;
};

// Leaves by their names; a list of values is a leaf.
void add_leaves(const YAML::Node& node, const std::string& name, std::vector<OptionValue>& leaves) {
  const std::string prefix = name.empty() ? "" : name + ".";
  if (node.IsMap()) {
    for (const auto& entry : node) add_leaves(entry.second, prefix + entry.first.Scalar(), leaves);
    return;
  }
  if (!node.IsSequence()) {
    leaves.push_back({name, node.IsScalar() ? node.Scalar() : ""});
    return;
  }
  std::string texts;
  bool has_sections = false;
  for (std::size_t i = 0; i < node.size(); ++i) {
    if (node[i].IsScalar()) {
      texts += (texts.empty() ? "" : ", ") + node[i].Scalar();
    } else {
      add_leaves(node[i], prefix + std::to_string(i), leaves);
      has_sections = true;
    }
  }
  if (!has_sections) leaves.push_back({name, "[" + texts + "]"});
}

// robots.12.edge -> robots.0.edge
std::string of_first_element(const std::string& name) {
  std::string result, word;
  for (std::size_t begin = 0; begin <= name.size();) {
    const std::size_t end = std::min(name.find('.', begin), name.size());
    word = name.substr(begin, end - begin);
    if (!word.empty() && word.find_first_not_of("0123456789") == std::string::npos) word = "0";
    result += (begin == 0 ? "" : ".") + word;
    begin = end + 1;
  }
  return result;
}

std::vector<OptionValue> leaves_of(const std::string& yaml, const std::string& where) {
  try {
    std::vector<OptionValue> leaves;
    add_leaves(YAML::Load(yaml), "", leaves);
    return leaves;
  } catch (const YAML::Exception& error) {
    throw Error(ErrorCode::kCorrupt, "it is no YAML: " + error.msg, where);
  }
}

}  // namespace

Json option_differences(const std::string& yaml, const std::string& defaults, const std::string& where) {
  std::map<std::string, std::string> default_of;
  for (OptionValue& leaf : leaves_of(defaults, "the defaults")) default_of[leaf.name] = std::move(leaf.value);
  Json differences = Json::array();
  for (const OptionValue& leaf : leaves_of(yaml, where)) {
    const auto known = default_of.find(of_first_element(leaf.name));
    if (known != default_of.end() && known->second == leaf.value) continue;
    if (known == default_of.end() && (leaf.value == "[]" || leaf.value.empty())) continue;
    differences.push_back(
        {{"name", leaf.name}, {"value", leaf.value}, {"default", known == default_of.end() ? "" : known->second}});
  }
  return differences;
}

}  // namespace mapweave::report
