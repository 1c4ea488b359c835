#include "option_text.h"
#include "yaml_tree.h"

#include <mapweave/core/files.h>
#include <mapweave/core/log.h>
#include <mapweave/core/nearest_name.h>
#include <mapweave/core/options.h>
#include <mapweave/core/renamed_options.h>
#include <unistd.h>

#include <algorithm>
#include <charconv>
#include <deque>

namespace mapweave {
namespace {

using Kind = YamlNode::Kind;
constexpr std::string_view kPrefix = "MAPWEAVE_";
constexpr std::string_view kReserved[] = {"MAPWEAVE_DATA"};  // where tests and benches find public logs

char small_letter(char c) { return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c; }
char capital_letter(char c) { return c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c; }

// MAPWEAVE_ROBOTS__0__EDGE <-> robots.0.edge
std::string key_of_variable(std::string_view variable) {
  std::string key;
  variable.remove_prefix(kPrefix.size());
  for (std::size_t i = 0; i < variable.size(); ++i) {
    const bool is_dot = variable.compare(i, 2, "__") == 0;
    key += is_dot ? '.' : small_letter(variable[i]);
    i += is_dot;
  }
  return key;
}
std::string variable_of_key(std::string_view key) {
  std::string variable(kPrefix);
  for (const char c : key) variable += c == '.' ? std::string("__") : std::string(1, capital_letter(c));
  return variable;
}

// robots[0].edge -> robots.0.edge
std::string with_dots(std::string_view key) {
  std::string dotted;
  for (const char c : key) {
    if (c != ']') dotted += c == '[' ? '.' : c;
  }
  return dotted;
}

std::string joined(const std::string& prefix, const std::string& name) {
  return prefix.empty() ? name : prefix + "." + name;
}

// Every key there is; a list without elements shows those of its first.
void collect_keys(const OptionFields& fields, const std::string& prefix, std::vector<std::string>& keys) {
  for (const auto& option : fields) {
    const std::string key = joined(prefix, option.name);
    keys.push_back(key);
    if (const auto* section = std::get_if<OptionSection>(&option.as)) collect_keys(section->fields, key, keys);
    if (const auto* list = std::get_if<OptionList>(&option.as)) {
      for (std::size_t i = 0; i < list->size(); ++i)
        collect_keys(list->element(i), joined(key, std::to_string(i)), keys);
      if (list->size() == 0) collect_keys(list->example(), joined(key, "0"), keys);
    }
  }
}

std::string_view last_name(std::string_view key) { return key.substr(key.rfind('.') + 1); }

Option* find_option(OptionFields& fields, std::string_view name) {
  const auto found =
      std::find_if(fields.begin(), fields.end(), [&](const Option& option) { return option.name == name; });
  return found == fields.end() ? nullptr : &*found;
}

// Also by the name that it had before; `prefix`: the section's key.
Option* find_option(OptionFields& fields, const std::string& prefix, std::string_view name) {
  if (Option* option = find_option(fields, name)) return option;
  const auto present = present_name(prefix, name);
  return present ? find_option(fields, *present) : nullptr;
}

// Where one layer's values come from, and how it speaks of places and keys.
struct Layer {
  ErrorCode code = ErrorCode::kBadInput;
  std::string name;            // a file, a variable, a setting
  std::filesystem::path file;  // empty unless a file
  bool is_environment = false;

  std::string place(int line) const { return file.empty() || line <= 0 ? name : name + ":" + std::to_string(line); }
  std::string spelt(const std::string& key) const { return is_environment ? variable_of_key(key) : key; }
  Error error(int line, std::string problem, std::string remedy) const {
    return {code, std::move(problem), place(line), std::move(remedy)};
  }
};

// "did you mean 'compose.resolution_m' or 'laser.graph.resolution_m'?"
std::string question(const std::vector<std::string>& keys, const Layer& layer) {
  std::string text;
  for (std::size_t i = 0; i < keys.size(); ++i)
    text += (i == 0 ? "did you mean '" : i + 1 < keys.size() ? "', '" : "' or '") + layer.spelt(keys[i]);
  return text + "'?";
}

// Keys whose last part is `name`, else `name` with a unit, else nearly `name`; those near the top first.
std::vector<std::string> keys_named_alike(std::string_view name, const std::vector<std::string>& keys) {
  constexpr std::size_t kMost = 3;
  const std::string before_unit = std::string(name) + "_";
  std::vector<std::string> last_names;
  for (const std::string& key : keys) last_names.emplace_back(last_name(key));
  const std::string nearest = nearest_name(name, last_names).value_or("");
  std::vector<std::string> equal, with_unit, near;
  for (const std::string& key : keys) {
    const std::string_view last = last_name(key);
    if (last == name) equal.push_back(key);
    if (last.substr(0, before_unit.size()) == before_unit) with_unit.push_back(key);
    if (last == nearest) near.push_back(key);
  }
  std::vector<std::string>& found = !equal.empty() ? equal : !with_unit.empty() ? with_unit : near;
  const auto depth = [](const std::string& key) { return std::count(key.begin(), key.end(), '.'); };
  std::stable_sort(found.begin(), found.end(), [&](const auto& a, const auto& b) { return depth(a) < depth(b); });
  found.resize(std::min(found.size(), kMost));
  return found;
}

// Whether values are what the options want is seen when they are put over those of all elements.
void put(const OptionOverrides& overrides, const std::string& key, const YamlNode& node, int line, const Layer& layer) {
  if (node.kind == Kind::map) {
    for (std::size_t i = 0; i < node.items.size(); ++i)
      put(overrides, joined(key, node.keys[i]), node.items[i], node.key_lines[i], layer);
    return;
  }
  if (node.kind == Kind::list)
    throw layer.error(line, "'" + shown_text(key) + "' is a list", "lists are the same for all elements");
  if (node.kind == Kind::null)
    throw layer.error(line, "'" + shown_text(key) + "' has no value", "give it one, or leave it out");
  OptionSetting setting{key, node.text, node.is_quoted, layer.place(line)};
  auto& settings = *overrides.settings;
  const auto known =
      std::find_if(settings.begin(), settings.end(), [&](const OptionSetting& one) { return one.key == key; });
  if (known != settings.end())
    *known = std::move(setting);
  else
    settings.push_back(std::move(setting));
}

bool is_not_finite(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(), small_letter);
  while (!text.empty() && (text.front() == '+' || text.front() == '-' || text.front() == '.')) text.erase(0, 1);
  return text == "nan" || text == "inf" || text == "infinity";
}

class Loader {
 public:
  explicit Loader(OptionFields fields) : root_(std::move(fields)) {}

  void apply_file(const std::filesystem::path& file) {
    const std::string bytes = read_file(file, kMostYamlBytes);
    const Layer layer{ErrorCode::kBadInput, file.string(), file, false};
    const YamlNode tree = parsed(bytes, layer);
    if (tree.kind == Kind::null) return;  // an empty file sets nothing
    if (tree.kind != Kind::map)
      throw layer.error(tree.line, "has no keys at its top", "a configuration consists of lines like 'key: value'");
    apply_section(root_, tree, {}, layer);
  }

  void apply_value(const std::string& key, std::string_view value, const Layer& layer) {
    apply_node(key, parsed(value, layer), layer);
  }

  void apply_node(const std::string& key, const YamlNode& node, const Layer& layer) {
    std::deque<OptionFields> elements;  // of the lists on the way, kept while they are looked into
    OptionFields* fields = &root_;
    std::string present;  // the key so far, as its options are called now
    for (std::size_t begin = 0;;) {
      const std::size_t end = std::min(key.find('.', begin), key.size());
      Option* option = find_option(*fields, present, std::string_view(key).substr(begin, end - begin));
      if (option == nullptr) throw unknown_key(key, layer);
      present = joined(present, option->name);
      if (end == key.size()) {
        if (present != key) note_renamed(layer.spelt(key), layer.spelt(present), layer.place(0));
        return apply(*option, node, present, layer);
      }
      begin = end + 1;
      if (auto* section = std::get_if<OptionSection>(&option->as)) {
        fields = &section->fields;
      } else if (const auto* list = std::get_if<OptionList>(&option->as)) {
        const std::size_t index_end = std::min(key.find('.', begin), key.size());
        elements.push_back(list->element(index_in(*list, key, begin, index_end, layer)));
        fields = &elements.back();
        present = joined(present, key.substr(begin, index_end - begin));
        if (index_end == key.size()) return apply_element(*fields, node, present, layer);
        begin = index_end + 1;
      } else if (const auto* overrides = std::get_if<OptionOverrides>(&option->as)) {
        note_origin(present, 0, layer);
        return put(*overrides, joined(option->name, key.substr(begin)), node, 0, layer);
      } else {
        throw unknown_key(key, layer);
      }
    }
  }

  Origins take_origins() { return std::move(origins_); }
  const std::vector<std::string>& notes() const { return notes_; }

 private:
  static YamlNode parsed(std::string_view bytes, const Layer& layer) {
    return parse_yaml(bytes, [&](int line, std::string problem, std::string remedy) {
      return layer.error(line, std::move(problem), std::move(remedy));
    });
  }

  static std::size_t index_in(const OptionList& list, const std::string& key, std::size_t begin, std::size_t end,
                              const Layer& layer) {
    std::size_t index = 0;
    const auto [stop, problem] = std::from_chars(key.data() + begin, key.data() + end, index);
    if (problem == std::errc() && stop == key.data() + end && begin < end && index < list.size()) return index;
    const std::string name = key.substr(0, begin - 1);
    throw layer.error(0,
                      "'" + shown_text(name) + "' has no element '" + shown_text(key.substr(begin, end - begin)) + "'",
                      list.size() == 0 ? "it is empty; give the list first"
                                       : "its elements are 0.." + std::to_string(list.size() - 1));
  }

  Error unknown_key(const std::string& key, const Layer& layer) const {
    std::vector<std::string> keys;
    collect_keys(root_, {}, keys);
    std::vector<std::string> meant;
    if (const auto nearest = nearest_name(key, keys)) meant = {*nearest};
    if (meant.empty()) meant = keys_named_alike(last_name(key), keys);
    return layer.error(0, "unknown key '" + shown_text(key) + "'",
                       meant.empty() ? "look for it: mapweave config reference --find WORD" : question(meant, layer));
  }

  // For a key in a section of a file: the keys beside it first, then the same name elsewhere.
  Error unknown_key_in(const OptionFields& fields, const std::string& name, int line, const Layer& layer) const {
    std::vector<std::string> known_here, keys;
    for (const auto& option : fields) known_here.push_back(option.name);
    collect_keys(root_, {}, keys);
    std::vector<std::string> meant;
    if (const auto nearest = nearest_name(name, known_here)) meant = {*nearest};
    if (meant.empty()) meant = keys_named_alike(name, keys);
    std::string remedy;
    for (const auto& known : known_here) remedy += (remedy.empty() ? "known here: " : ", ") + known;
    return layer.error(line, "unknown key '" + shown_text(name) + "'", meant.empty() ? remedy : question(meant, layer));
  }

  void apply_section(OptionFields& fields, const YamlNode& map, const std::string& prefix, const Layer& layer) {
    for (std::size_t i = 0; i < map.items.size(); ++i) {
      const std::string& name = map.keys[i];
      const int line = map.key_lines[i];
      Option* option = find_option(fields, prefix, name);
      if (option == nullptr) throw unknown_key_in(fields, name, line, layer);
      const std::string key = joined(prefix, option->name);
      if (option->name != name) {
        if (std::count(map.keys.begin(), map.keys.end(), option->name) > 0)
          throw layer.error(line, "'" + name + "' is the old name of '" + option->name + "', which is set as well",
                            "remove '" + name + "'");
        note_renamed(name, key, layer.place(line));
      }
      apply(*option, map.items[i], key, layer, line);
    }
  }

  void apply_element(OptionFields& fields, const YamlNode& node, const std::string& key, const Layer& layer) {
    if (node.kind != Kind::map)
      throw wrong(key, node, node.line, "each element has keys of its own, like 'id: ...'", layer);
    note_origin(key, node.line, layer);
    apply_section(fields, node, key, layer);
  }

  void apply(Option& option, const YamlNode& node, const std::string& key, const Layer& layer, int key_line = 0) {
    const int line = node.line > 0 ? node.line : key_line;
    if (auto* section = std::get_if<OptionSection>(&option.as)) {
      note_origin(key, key_line, layer);
      if (node.kind == Kind::null) return;  // "laser:" with nothing below sets nothing
      if (node.kind != Kind::map) throw wrong(option.name, node, line, requirement(option), layer);
      return apply_section(section->fields, node, key, layer);
    }
    if (node.kind == Kind::null)
      throw layer.error(key_line > 0 ? key_line : line, "'" + option.name + "' has no value", remedy_of_null(option));
    note_origin(key, key_line, layer);
    if (auto* overrides = std::get_if<OptionOverrides>(&option.as))
      return put(*overrides, option.name, node, line, layer);
    if (auto* list = std::get_if<OptionList>(&option.as)) return apply_list(option, *list, node, key, line, layer);
    if (auto* texts = std::get_if<OptionTexts>(&option.as)) return apply_texts(option, *texts, node, key, line, layer);
    if (node.kind != Kind::scalar || !set_scalar(option, node, line, layer))
      throw wrong(option.name, node, line, requirement_of_type(option), layer);
  }

  void apply_list(const Option& option, const OptionList& list, const YamlNode& node, const std::string& key, int line,
                  const Layer& layer) {
    if (node.kind != Kind::list) throw wrong(option.name, node, line, requirement(option), layer);
    origins_.forget_below(key);
    list.resize(0);
    list.resize(node.items.size());
    for (std::size_t i = 0; i < node.items.size(); ++i) {
      OptionFields fields = list.element(i);
      apply_element(fields, node.items[i], joined(key, std::to_string(i)), layer);
    }
  }

  void apply_texts(const Option& option, const OptionTexts& texts, const YamlNode& node, const std::string& key,
                   int line, const Layer& layer) {
    if (node.kind != Kind::list) throw wrong(option.name, node, line, requirement(option), layer);
    origins_.forget_below(key);
    texts.values->clear();
    for (const YamlNode& item : node.items) {
      if (item.kind != Kind::scalar)
        throw wrong(option.name, item, item.line > 0 ? item.line : line, requirement(option), layer);
      note_origin(joined(key, std::to_string(texts.values->size())), item.line > 0 ? item.line : line, layer);
      texts.values->push_back(item.text);
    }
  }

  // False when the text is of another type; throws when it is out of range.
  static bool set_scalar(Option& option, const YamlNode& node, int line, const Layer& layer) {
    const auto out_of_range = [&] { return wrong(option.name, node, line, requirement(option), layer); };
    if (auto* text = std::get_if<OptionText>(&option.as)) {
      *text->value = node.text;
      return true;
    }
    if (auto* choice = std::get_if<OptionChoice>(&option.as)) {
      const auto found = std::find(choice->names.begin(), choice->names.end(), node.text);
      if (found == choice->names.end()) {
        const auto meant = nearest_name(node.text, choice->names);
        throw wrong(option.name, node, line, requirement(option) + (meant ? "; did you mean '" + *meant + "'?" : ""),
                    layer);
      }
      choice->set(static_cast<std::size_t>(found - choice->names.begin()));
      return true;
    }
    if (node.is_quoted) return false;
    if (auto* flag = std::get_if<OptionFlag>(&option.as)) {
      *flag->value = node.text == "true";
      return node.text == "true" || node.text == "false";
    }
    const char* begin = node.text.data();
    const char* end = begin + node.text.size();
    if (end - begin > 1 && *begin == '+' && begin[1] != '-') ++begin;
    if (auto* integer = std::get_if<OptionInteger>(&option.as)) {
      std::int64_t value = 0;
      const auto [stop, problem] = std::from_chars(begin, end, value);
      if (stop != end || problem == std::errc::invalid_argument) return false;
      if (problem != std::errc() || !is_in_range(*integer, value)) throw out_of_range();
      integer->set(value);
      return true;
    }
    auto& number = std::get<OptionNumber>(option.as);
    if (is_not_finite(node.text)) throw out_of_range();
    double value = 0.0;
    const auto [stop, problem] = std::from_chars(begin, end, value);
    if (stop != end || problem == std::errc::invalid_argument) return false;
    if (problem != std::errc() || !is_in_range(number, value)) throw out_of_range();
    *number.value = value;
    return true;
  }

  static std::string requirement_of_type(const Option& option) {
    if (std::holds_alternative<OptionNumber>(option.as)) return "it must be a number";
    if (std::holds_alternative<OptionInteger>(option.as)) return "it must be a whole number";
    return requirement(option);
  }

  static std::string remedy_of_null(const Option& option) {
    if (std::holds_alternative<OptionText>(option.as))
      return "write \"\" for an empty text, and quotes around a text like null or ~";
    if (std::holds_alternative<OptionList>(option.as) || std::holds_alternative<OptionTexts>(option.as))
      return "write [] for an empty list";
    return requirement(option);
  }

  static Error wrong(const std::string& name, const YamlNode& node, int line, const std::string& remedy,
                     const Layer& layer) {
    std::string value = shown_text(node.text);
    if (node.kind == Kind::null) value = "empty";
    if (node.kind == Kind::list) value = "a list";
    if (node.kind == Kind::map) value = "a section";
    const bool is_number = !node.text.empty() && node.text.find_first_not_of("0123456789+-.eE") == std::string::npos;
    if (node.kind == Kind::scalar && (node.is_quoted || !is_number)) value = "'" + value + "'";
    return layer.error(line, "'" + name + "' is " + value, remedy);
  }

  void note_origin(const std::string& key, int line, const Layer& layer) {
    origins_.set(key, {layer.place(line), layer.file});
  }

  void note_renamed(const std::string& before, const std::string& now, const std::string& place) {
    notes_.push_back(place + ": '" + before + "' is now called '" + now + "'; the old name works in this version");
  }

  OptionFields root_;
  Origins origins_;
  std::vector<std::string> notes_;
};

}  // namespace

std::vector<std::pair<std::string, std::string>> process_environment() {
  std::vector<std::pair<std::string, std::string>> variables;
  for (char** entry = environ; entry != nullptr && *entry != nullptr; ++entry) {
    const std::string_view text(*entry);
    const auto equals = text.find('=');
    if (equals == std::string_view::npos) continue;
    variables.emplace_back(text.substr(0, equals), text.substr(equals + 1));
  }
  std::sort(variables.begin(), variables.end());
  return variables;
}

bool Origins::is_given(std::string_view key) const { return origins_.count(with_dots(key)) > 0; }

Origins::Origin Origins::origin_of(std::string_view key) const {
  for (std::string around = with_dots(key);;) {
    const auto found = origins_.find(around);
    if (found != origins_.end()) return found->second;
    const auto dot = around.rfind('.');
    if (dot == std::string::npos) return {};
    around.resize(dot);
  }
}

void Origins::forget_below(const std::string& key) {
  const std::string prefix = key + ".";
  auto first = origins_.lower_bound(prefix), last = first;
  while (last != origins_.end() && last->first.compare(0, prefix.size(), prefix) == 0) ++last;
  origins_.erase(first, last);
}

void override_fields(OptionFields fields, const std::vector<OptionSetting>& settings) {
  Loader loader(std::move(fields));
  for (const OptionSetting& setting : settings) {
    YamlNode node;
    node.kind = Kind::scalar;
    node.text = setting.value;
    node.is_quoted = setting.is_quoted;
    loader.apply_node(setting.key, node, {ErrorCode::kBadInput, setting.place, {}, false});
  }
}

Origins load_fields(OptionFields fields, const ConfigurationSources& sources) {
  Loader loader(std::move(fields));
  for (const auto& file : sources.files) loader.apply_file(file);
  for (const auto& [variable, value] : sources.environment) {
    if (variable.compare(0, kPrefix.size(), kPrefix) != 0) continue;
    if (std::find(std::begin(kReserved), std::end(kReserved), variable) != std::end(kReserved)) continue;
    loader.apply_value(key_of_variable(variable), value,
                       {ErrorCode::kBadInput, "environment variable " + variable, {}, true});
  }
  for (const auto& setting : sources.settings) {
    const Layer layer{ErrorCode::kUsage, "--set " + shown_text(setting), {}, false};
    const auto equals = setting.find('=');
    if (equals == std::string::npos) throw layer.error(0, "has no '='", "write --set key=value");
    loader.apply_value(with_dots(std::string_view(setting).substr(0, equals)),
                       std::string_view(setting).substr(equals + 1), layer);
  }
  for (const std::string& note : loader.notes()) log(LogLevel::warning, note);
  return loader.take_origins();
}

}  // namespace mapweave
