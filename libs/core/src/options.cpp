#include "option_text.h"

#include <mapweave/core/options.h>

#include <algorithm>
#include <charconv>
#include <cmath>

namespace mapweave {
namespace {

bool is_option_name(std::string_view name) {
  const auto allowed = [](char c) { return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '_'; };
  return !name.empty() && name.front() >= 'a' && name.back() != '_' && std::all_of(name.begin(), name.end(), allowed) &&
         name.find("__") == std::string_view::npos;  // two underscores are a dot in the environment
}

void check_below(const OptionFields& fields, const std::string& prefix) {
  for (const auto& option : fields) {
    const std::string key = prefix + option.name;
    const auto refuse = [&](const std::string& value) {
      throw Error(ErrorCode::kBadInput, "'" + key + "' is " + value, {}, requirement(option));
    };
    if (const auto* number = std::get_if<OptionNumber>(&option.as)) {
      if (!is_in_range(*number, *number->value)) refuse(text_of_number(*number->value));
    } else if (const auto* integer = std::get_if<OptionInteger>(&option.as)) {
      if (!is_in_range(*integer, integer->get())) refuse(std::to_string(integer->get()));
    } else if (const auto* choice = std::get_if<OptionChoice>(&option.as)) {
      if (choice->get() >= choice->names.size()) refuse("a value without a name");
    } else if (const auto* section = std::get_if<OptionSection>(&option.as)) {
      check_below(section->fields, key + ".");
    } else if (const auto* list = std::get_if<OptionList>(&option.as)) {
      for (std::size_t i = 0; i < list->size(); ++i) check_below(list->element(i), key + "." + std::to_string(i) + ".");
    }
  }
}

}  // namespace

void OptionVisitor::add(std::string_view name, std::string_view doc, decltype(Option::as) as) {
  MAPWEAVE_EXPECT(is_option_name(name), "'" + std::string(name) + "' cannot be the name of an option");
  for (const auto& option : fields_)
    MAPWEAVE_EXPECT(option.name != name, "two options are called '" + option.name + "'");
  fields_.push_back({std::string(name), std::string(doc), std::move(as)});
}

void check_fields(const OptionFields& fields) { check_below(fields, {}); }

std::string text_of_number(double value) {
  if (!std::isfinite(value)) return std::isnan(value) ? ".nan" : value > 0.0 ? ".inf" : "-.inf";
  char buffer[64];
  const double size = std::abs(value);
  const auto format =
      size == 0.0 || (size >= 1e-4 && size < 1e15) ? std::chars_format::fixed : std::chars_format::scientific;
  const auto result = std::to_chars(buffer, buffer + sizeof buffer, value, format);
  return {buffer, result.ptr};
}

bool is_in_range(const OptionNumber& option, double value) {
  return std::isfinite(value) && value >= option.low && value <= option.high &&
         !(option.above_low && value == option.low);
}

bool is_in_range(const OptionInteger& option, std::int64_t value) {
  return value >= option.low && value <= option.high;
}

std::string range_text(const Option& option) {
  if (const auto* number = std::get_if<OptionNumber>(&option.as)) {
    if (std::isfinite(number->high)) return text_of_number(number->low) + ".." + text_of_number(number->high);
    return number->above_low ? "greater than " + text_of_number(number->low) : text_of_number(number->low) + " or more";
  }
  if (const auto* integer = std::get_if<OptionInteger>(&option.as))
    return std::to_string(integer->low) + ".." + std::to_string(integer->high);
  if (const auto* choice = std::get_if<OptionChoice>(&option.as)) {
    std::string text;
    for (std::size_t i = 0; i < choice->names.size(); ++i)
      text += (i == 0 ? "" : i + 1 < choice->names.size() ? ", " : " or ") + choice->names[i];
    return text;
  }
  return std::holds_alternative<OptionFlag>(option.as) ? "true or false" : "";
}

std::string requirement(const Option& option) {
  if (const auto* number = std::get_if<OptionNumber>(&option.as)) {
    return (std::isfinite(number->high) ? "it must lie in " : "it must be ") + range_text(option);
  }
  if (std::holds_alternative<OptionInteger>(option.as)) return "it must lie in " + range_text(option);
  if (std::holds_alternative<OptionText>(option.as)) return "it must be text";
  if (std::holds_alternative<OptionTexts>(option.as)) return "it must be a list of texts, like [north, south]";
  if (std::holds_alternative<OptionSection>(option.as)) return "it must be a section with keys of its own";
  if (std::holds_alternative<OptionList>(option.as)) return "it must be a list";
  return "it must be " + range_text(option);
}

}  // namespace mapweave
