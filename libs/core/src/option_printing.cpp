#include "option_text.h"

#include <mapweave/core/option_search.h>
#include <mapweave/core/options.h>

#include <algorithm>
#include <cctype>
#include <cstdio>

namespace mapweave {
namespace {

// Plain where no reader of YAML could take it for anything but this text.
bool can_be_plain(const std::string& text) {
  static const std::vector<std::string> kWords = {"true", "false", "yes", "no", "on", "off", "null", "y", "n"};
  std::string small;
  for (const char c : text) {
    const bool letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
    const bool other = (c >= '0' && c <= '9') || c == '_' || c == '-' || c == '.' || c == '/';
    if (!letter && !other) return false;
    if (small.empty() && !letter && c != '/' && c != '_') return false;
    small += c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  }
  return !text.empty() && std::find(kWords.begin(), kWords.end(), small) == kWords.end();
}

std::string yaml_of_text(const std::string& text) {
  if (can_be_plain(text)) return text;
  std::string quoted = "\"";
  for (const char c : text) {
    if (c == '"' || c == '\\') {
      quoted += '\\';
      quoted += c;
    } else if (static_cast<unsigned char>(c) < 0x20 || c == 0x7F) {
      char code[8];
      std::snprintf(code, sizeof code, "\\x%02X", static_cast<unsigned>(c));
      quoted += code;
    } else {
      quoted += c;
    }
  }
  return quoted + '"';
}

// {graph: {min_score: 0.5}} of what begins at `depth` with `prefix`, which ends with a dot; a plain value where the
// prefix has none.
std::string yaml_of_overrides(const std::vector<OptionSetting>& settings, const std::string& prefix) {
  std::vector<std::string> names;
  for (const OptionSetting& setting : settings) {
    if (setting.key.compare(0, prefix.size(), prefix) != 0) continue;
    const std::string name = setting.key.substr(prefix.size(), setting.key.find('.', prefix.size()) - prefix.size());
    if (std::find(names.begin(), names.end(), name) == names.end()) names.push_back(name);
  }
  std::string text;
  for (const std::string& name : names) {
    const auto leaf = std::find_if(settings.begin(), settings.end(),
                                   [&](const OptionSetting& one) { return one.key == prefix + name; });
    text += (text.empty() ? "" : ", ") + name + ": ";
    if (leaf == settings.end())
      text += yaml_of_overrides(settings, prefix + name + ".");
    else
      text += leaf->is_quoted ? yaml_of_text(leaf->value) : leaf->value;
  }
  return "{" + text + "}";
}

std::string yaml_of_overrides(const Option& option, const OptionOverrides& overrides) {
  for (const OptionSetting& setting : *overrides.settings)
    if (setting.key == option.name) return setting.is_quoted ? yaml_of_text(setting.value) : setting.value;
  return yaml_of_overrides(*overrides.settings, option.name + ".");
}

std::string yaml_of_scalar(const Option& option) {
  if (const auto* overrides = std::get_if<OptionOverrides>(&option.as)) return yaml_of_overrides(option, *overrides);
  if (const auto* number = std::get_if<OptionNumber>(&option.as)) return text_of_number(*number->value);
  if (const auto* integer = std::get_if<OptionInteger>(&option.as)) return std::to_string(integer->get());
  if (const auto* flag = std::get_if<OptionFlag>(&option.as)) return *flag->value ? "true" : "false";
  if (const auto* text = std::get_if<OptionText>(&option.as)) return yaml_of_text(*text->value);
  if (const auto* texts = std::get_if<OptionTexts>(&option.as)) {
    std::string list;
    for (const std::string& one : *texts->values) list += (list.empty() ? "" : ", ") + yaml_of_text(one);
    return "[" + list + "]";
  }
  const auto& choice = std::get<OptionChoice>(option.as);
  MAPWEAVE_EXPECT(choice.get() < choice.names.size(), "'" + option.name + "' holds a value without a name");
  return yaml_of_text(choice.names[choice.get()]);
}

// What the option means, and its range.
std::string note_of(const Option& option) {
  const std::string range = range_text(option);
  std::string note = option.doc + (range.empty() ? "" : " (" + range + ")");
  std::replace(note.begin(), note.end(), '\n', ' ');
  return note;
}

class Printer {
 public:
  explicit Printer(bool with_comments) : with_comments_(with_comments) {}
  std::string text;

  // `lead` begins each line. In a list's element the first key stands behind the dash.
  void print(const OptionFields& fields, const std::string& lead, bool in_element = false) {
    std::string own_lead = in_element ? lead + "- " : lead;
    const std::string rest_lead = in_element ? lead + "  " : lead;
    if (fields.empty() && in_element) text += own_lead + "{}\n";
    for (const auto& option : fields) {
      if (!with_comments_ && says_nothing(option)) continue;
      comment(option, rest_lead);
      const auto* section = std::get_if<OptionSection>(&option.as);
      const auto* list = std::get_if<OptionList>(&option.as);
      text += own_lead + option.name + ":";
      own_lead = rest_lead;
      if (section != nullptr) {
        text += section->fields.empty() ? " {}\n" : "\n";
        print(section->fields, rest_lead + "  ");
      } else if (list != nullptr) {
        print(*list, rest_lead);
      } else {
        text += " " + yaml_of_scalar(option) + "\n";
      }
    }
  }

 private:
  void print(const OptionList& list, const std::string& lead) {
    text += list.size() == 0 ? " []\n" : "\n";
    for (std::size_t i = 0; i < list.size(); ++i) {
      Printer element(false);  // the example below explains
      element.print(list.element(i), lead + "  ", true);
      text += element.text;
    }
    if (with_comments_) print_example(list.example(), lead + "# ", true);
  }

  void print_example(const OptionFields& fields, const std::string& lead, bool is_element) {
    std::string own_lead = is_element ? lead + "- " : lead;
    const std::string rest_lead = is_element ? lead + "  " : lead;
    for (const auto& option : fields) {
      const auto* section = std::get_if<OptionSection>(&option.as);
      const auto* list = std::get_if<OptionList>(&option.as);
      text += own_lead + option.name + ":" +
              (section ? ""
               : list  ? " []"
                       : " " + yaml_of_scalar(option)) +
              "  # " + note_of(option) + "\n";
      own_lead = rest_lead;
      if (section != nullptr) print_example(section->fields, rest_lead + "  ", false);
      if (list != nullptr) print_example(list->example(), rest_lead + "# ", true);
    }
  }

  static bool says_nothing(const Option& option) {
    const auto* overrides = std::get_if<OptionOverrides>(&option.as);
    return overrides != nullptr && yaml_of_overrides(option, *overrides) == "{}";
  }

  void comment(const Option& option, const std::string& lead) {
    if (with_comments_) text += lead + "# " + note_of(option) + "\n";
  }

  bool with_comments_;
};

std::string in_small_letters(std::string text) {
  std::transform(text.begin(), text.end(), text.begin(),
                 [](unsigned char letter) { return static_cast<char>(std::tolower(letter)); });
  return text;
}

void find_below(const OptionFields& fields, const std::string& prefix, const std::vector<std::string>& words,
                std::string& text) {
  for (const Option& option : fields) {
    const std::string key = prefix + option.name, note = note_of(option), all = in_small_letters(key + " " + note);
    const auto* section = std::get_if<OptionSection>(&option.as);
    const auto* list = std::get_if<OptionList>(&option.as);
    if (std::all_of(words.begin(), words.end(), [&](const auto& word) { return all.find(word) != std::string::npos; }))
      text += key + ":" + (section || list ? "" : " " + yaml_of_scalar(option)) + "\n    " + note + "\n";
    if (section != nullptr) find_below(section->fields, key + ".", words, text);
    if (list != nullptr) find_below(list->example(), key + ".0.", words, text);
  }
}

}  // namespace

std::string found_in_fields(const OptionFields& fields, std::vector<std::string> words) {
  for (std::string& word : words) word = in_small_letters(std::move(word));
  std::string text;
  find_below(fields, {}, words, text);
  return text;
}

std::string yaml_of_fields(const OptionFields& fields) {
  Printer printer(false);
  printer.print(fields, {});
  return fields.empty() ? "{}\n" : printer.text;
}

std::vector<std::string> changed_keys_of_fields(const OptionFields& before, const OptionFields& after) {
  MAPWEAVE_EXPECT(before.size() == after.size(), "options of two structs cannot be compared");
  std::vector<std::string> result;
  for (std::size_t i = 0; i < before.size(); ++i) {
    const auto *one = std::get_if<OptionSection>(&before[i].as), *other = std::get_if<OptionSection>(&after[i].as);
    if (one != nullptr && other != nullptr)
      for (const std::string& key : changed_keys_of_fields(one->fields, other->fields))
        result.push_back(before[i].name + "." + key);
    else if (yaml_of_fields({before[i]}) != yaml_of_fields({after[i]}))
      result.push_back(before[i].name);
  }
  return result;
}

std::string reference_of_fields(const OptionFields& fields, std::string_view title) {
  std::string page;
  for (std::size_t begin = 0; begin <= title.size();) {
    const std::size_t end = std::min(title.find('\n', begin), title.size());
    page += end == begin ? "#\n" : "# " + std::string(title.substr(begin, end - begin)) + "\n";
    begin = end + 1;
  }
  Printer printer(true);
  printer.print(fields, {});
  return page + "\n" + printer.text;
}

}  // namespace mapweave
