#include "command_line.h"

#include <mapweave/core/nearest_name.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <optional>
#include <sstream>

namespace mapweave::app {
namespace {

std::string joined(const std::vector<std::string>& words, const std::string& between, const std::string& before_last) {
  std::string text;
  for (std::size_t i = 0; i < words.size(); ++i)
    text += (i == 0 ? "" : i + 1 < words.size() ? between : before_last) + words[i];
  return text;
}

// nullopt for what is no number, or not a finite one.
std::optional<double> number_in(const std::string& text) {
  double value = 0.0;
  if (!CLI::detail::lexical_cast(text, value) || !std::isfinite(value)) return std::nullopt;
  return value;
}

std::string short_text(double value) {
  std::ostringstream text;
  text.precision(12);
  text << value;
  return text.str();
}

class HelpFormatter : public CLI::Formatter {
 public:
  std::string make_option_opts(const CLI::Option* option) const override {
    if (option->get_type_size() == 0) return "";  // a flag
    std::string text = value_text(option->get_type_name());
    if (!text.empty()) text = " " + text;
    if (!option->get_positional() && option->get_required()) text += " (required)";
    if (!option->get_default_str().empty()) text += " (default " + option->get_default_str() + ")";
    return text;
  }

  std::string make_option_desc(const CLI::Option* option) const override { return wrapped(option->get_description()); }
  std::string make_subcommand(const CLI::App* verb) const override {
    std::ostringstream text;
    CLI::detail::format_help(text, verb->get_name(), wrapped(verb->get_description()), get_column_width());
    return text.str();
  }

 private:
  // The parser's "TEXT:graph|icp", "INT:1..9" and "FILE" are "graph|icp", "N, 1..9" and "FILE".
  static std::string value_text(const std::string& type) {
    const auto colon = type.find(':');
    std::string name = type.substr(0, colon), range = colon == std::string::npos ? "" : type.substr(colon + 1);
    if (name == "TEXT") return range;
    if (name == "INT" || name == "UINT" || name == "FLOAT") name = "NUMBER";
    return range.empty() ? name : name + ", " + range;
  }

  static std::string wrapped(const std::string& text) {
    constexpr std::size_t kColumns = 88;
    std::istringstream words(text);
    std::string result, word;
    for (std::size_t length = 0; words >> word;) {
      const bool is_new_line = length > 0 && length + 1 + word.size() > kColumns;
      if (length > 0) result += is_new_line ? "\n" : " ";
      length = is_new_line || length == 0 ? word.size() : length + 1 + word.size();
      result += word;
    }
    return result;
  }
};

const CLI::App& last_parsed(const CLI::App& program) {
  const CLI::App* verb = &program;
  while (!verb->get_subcommands().empty()) verb = verb->get_subcommands().back();
  return *verb;
}

// "config reference"; empty for the program.
std::string full_name(const CLI::App& verb) {
  if (verb.get_parent() == nullptr) return "";
  const std::string above = full_name(*verb.get_parent());
  return above + (above.empty() ? "" : " ") + verb.get_name();
}

std::vector<std::string> flags_of(const CLI::App& verb) {
  std::vector<std::string> flags;
  for (const CLI::App* app = &verb; app != nullptr; app = app->get_parent())
    for (const CLI::Option* option : app->get_options())
      for (const std::string& name : option->get_lnames()) flags.push_back("--" + name);
  return flags;
}

std::vector<std::string> subcommands_of(const CLI::App& verb) {
  std::vector<std::string> names;
  for (const CLI::App* one : verb.get_subcommands([](const CLI::App*) { return true; }))
    names.push_back(one->get_name());
  return names;
}

std::string question(const std::string& name, const std::vector<std::string>& known) {
  const auto nearest = nearest_name(name, known);
  return nearest ? "did you mean '" + *nearest + "'?" : "";
}

// The first argument that nobody took; a flag before others, since its value is left over, too.
std::string left_over(const CLI::App& program) {
  const std::vector<std::string> arguments = program.remaining(true);
  const auto flag = std::find_if(arguments.begin(), arguments.end(),
                                 [](const std::string& one) { return one.size() > 1 && one.front() == '-'; });
  return flag != arguments.end() ? *flag : arguments.empty() ? "" : arguments.front();
}

// One that takes a single value, and was given several.
const CLI::Option* doubled_option(const CLI::App& verb) {
  for (const CLI::App* app = &verb; app != nullptr; app = app->get_parent())
    for (const CLI::Option* option : app->get_options())
      if (option->get_expected_max() == 1 && option->results().size() > 1) return option;
  return nullptr;
}

// The one whose absence the parser found.
const CLI::Option* missing_option(const CLI::App& verb) {
  for (const CLI::Option* option : verb.get_options())
    if (option->get_required() && option->count() == 0) return option;
  return nullptr;
}

std::string missing_text(const CLI::Option& option) {
  if (option.get_positional()) return option.get_name() + " is missing";
  const std::string value = option.get_type_name();
  return "--" + option.get_lnames().front() + " " + value.substr(0, value.find(':')) + " is missing";
}

}  // namespace

CLI::Validator one_of(std::vector<std::string> names) {
  const std::string description = joined(names, "|", "|");
  const auto check = [names](std::string& value) -> std::string {
    if (std::find(names.begin(), names.end(), value) != names.end()) return "";
    const std::string nearest = question(value, names);
    return "'" + value + "' is not one of " + joined(names, ", ", " or ") + (nearest.empty() ? "" : "; " + nearest);
  };
  return CLI::Validator(check, description);
}

CLI::Validator whole_number(std::int64_t low, std::int64_t high) {
  const std::string range = std::to_string(low) + ".." + std::to_string(high);
  const auto check = [=](std::string& text) -> std::string {
    std::int64_t value = 0;
    const auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), value);
    const bool is_whole = problem == std::errc() && end == text.data() + text.size();
    const bool is_in_range = is_whole && value >= low && value <= high;
    return is_in_range ? "" : "'" + text + "' is not a whole number in " + range;
  };
  return CLI::Validator(check, range);
}

CLI::Validator number(double low) {
  const bool is_bounded = std::isfinite(low);
  const std::string range = is_bounded ? short_text(low) + " or more" : "";
  const auto check = [=](std::string& text) -> std::string {
    const auto value = number_in(text);
    if (value && *value >= low) return "";
    return "'" + text + "' is not a number" + (is_bounded ? " of " + range : "");
  };
  return CLI::Validator(check, range);
}

void show_examples(CLI::App& verb, const std::vector<std::string>& commands) {
  std::string text = commands.size() == 1 ? "Example:" : "Examples:";
  for (const std::string& command : commands) text += "\n  " + command;
  verb.footer(text);
}

std::shared_ptr<CLI::Formatter> help_formatter() {
  auto formatter = std::make_shared<HelpFormatter>();
  formatter->label("SUBCOMMAND", "VERB");
  formatter->label("Positionals", "Arguments");
  return formatter;
}

std::vector<std::string> with_help_as_flag(std::vector<std::string> arguments) {
  auto first = arguments.begin();  // that is no flag of the program's own
  while (first != arguments.end() && !first->empty() && first->front() == '-')
    first += *first == "--log-level" && std::next(first) != arguments.end() ? 2 : 1;
  if (first == arguments.end() || *first != "help") return arguments;
  arguments.erase(first);
  arguments.emplace_back("--help");
  return arguments;
}

Error usage_error(const CLI::App& program, const CLI::ParseError& error) {
  const CLI::App& verb = last_parsed(program);
  const std::string name = full_name(verb), help = program.get_name() + (name.empty() ? "" : " " + name) + " --help";
  const auto because = [&](const std::string& what, const std::string& remedy) {
    return Error(ErrorCode::kUsage, what, name, remedy.empty() ? help + " shows what there is" : remedy);
  };
  const std::string extra = left_over(program);
  const std::vector<std::string> known = subcommands_of(verb);
  if (extra.size() > 1 && extra.front() == '-')
    return because("there is no option '" + extra + "'", question(extra.substr(0, extra.find('=')), flags_of(verb)));
  if (!known.empty()) {
    const std::string what =
        name.empty() ? "the verb is missing" : "it is not said what: " + joined(known, ", ", " or ");
    if (extra.empty()) return because(what, help + " explains them");
    return because("there is no '" + name + " " + extra + "'; there is: " + joined(known, ", ", " and "),
                   question(extra, known));
  }
  if (dynamic_cast<const CLI::RequiredError*>(&error) != nullptr)
    if (const CLI::Option* option = missing_option(verb))
      return because(missing_text(*option), help + " shows an example");
  if (!extra.empty()) return because("'" + extra + "' is more than it takes", help + " shows an example");
  const std::string text = error.what();
  if (const CLI::Option* option = doubled_option(verb))
    return because(option->get_name() + " is given twice", "give it once");
  if (dynamic_cast<const CLI::ArgumentMismatch*>(&error) != nullptr)
    return because(text.substr(0, text.find(':')) + " needs a value", help + " shows which");
  return because(text, help + " says more");
}

}  // namespace mapweave::app
