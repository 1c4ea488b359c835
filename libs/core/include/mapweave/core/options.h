#pragma once
// Options described once. An options struct says in describe() what it has; loading, checking, printing and the
// reference page all follow from that:
//
//   struct MatcherOptions {
//     double min_score = 0.5;
//     template <class Visitor>
//     void describe(Visitor& v) {
//       v.fraction("min_score", min_score, "mean occupancy under the scan");
//     }
//   };
//
// Layers, the later over the earlier: defaults, files in their order, environment, settings of the command line.
// A list given by a later layer replaces the earlier list.

#include <mapweave/core/error.h>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <initializer_list>
#include <limits>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

namespace mapweave {

struct Option;
using OptionFields = std::vector<Option>;

// One field of an options struct, tied to a struct that must outlive it.
struct OptionNumber {
  double* value;
  double low, high;  // high may be infinity: no bound
  bool above_low;    // low itself is not allowed
};
struct OptionInteger {
  std::int64_t low, high;
  std::function<std::int64_t()> get;
  std::function<void(std::int64_t)> set;
};
struct OptionFlag {
  bool* value;
};
struct OptionText {
  std::string* value;
};
struct OptionTexts {
  std::vector<std::string>* values;
};
struct OptionChoice {
  std::vector<std::string> names;
  std::function<std::size_t()> get;  // index into names; names.size() for a value without a name
  std::function<void(std::size_t)> set;
};
struct OptionSection {
  OptionFields fields;
};
// A value of an option of the whole struct, said again for one element of a list.
struct OptionSetting {
  std::string key, value;  // "laser.graph.min_score"; a scalar of YAML
  bool is_quoted = false;
  std::string place;  // where it was given
};
struct OptionOverrides {
  std::vector<OptionSetting>* settings;  // those whose key begins with the option's name are its
};
struct OptionList {
  std::function<std::size_t()> size;
  std::function<void(std::size_t)> resize;           // new elements have their defaults
  std::function<OptionFields(std::size_t)> element;  // good until the next resize
  std::function<OptionFields()> example;             // an element with its defaults
};
struct Option {
  std::string name, doc;
  std::variant<OptionNumber, OptionInteger, OptionFlag, OptionText, OptionTexts, OptionChoice, OptionSection,
               OptionOverrides, OptionList>
      as;
};

// The visitor that describe() meets. Names: small letters, digits and single underscores, unique in their struct.
class OptionVisitor {
 public:
  void positive(std::string_view name, double& value, std::string_view doc) {
    add(name, doc, OptionNumber{&value, 0.0, std::numeric_limits<double>::infinity(), true});
  }
  void non_negative(std::string_view name, double& value, std::string_view doc) {
    add(name, doc, OptionNumber{&value, 0.0, std::numeric_limits<double>::infinity(), false});
  }
  void fraction(std::string_view name, double& value, std::string_view doc) { number(name, value, 0.0, 1.0, doc); }
  void number(std::string_view name, double& value, double low, double high, std::string_view doc) {
    add(name, doc, OptionNumber{&value, low, high, false});
  }
  template <class Int>
  void integer(std::string_view name, Int& value, std::int64_t low, std::int64_t high, std::string_view doc) {
    static_assert(std::is_integral_v<Int>);
    MAPWEAVE_EXPECT(fits<Int>(low) && fits<Int>(high),
                    "the range of '" + std::string(name) + "' does not fit its type");
    add(name, doc,
        OptionInteger{low, high, [&value] { return static_cast<std::int64_t>(value); },
                      [&value](std::int64_t given) { value = static_cast<Int>(given); }});
  }
  void flag(std::string_view name, bool& value, std::string_view doc) { add(name, doc, OptionFlag{&value}); }
  void text(std::string_view name, std::string& value, std::string_view doc) { add(name, doc, OptionText{&value}); }
  void texts(std::string_view name, std::vector<std::string>& values, std::string_view doc) {
    add(name, doc, OptionTexts{&values});
  }
  // In an element of a list: a section or an option of the outermost struct, under its own name, to be said again for
  // this element alone. Several may share `settings`, which override_options() puts over a copy.
  void overrides(std::string_view name, std::vector<OptionSetting>& settings, std::string_view doc) {
    add(name, doc, OptionOverrides{&settings});
  }
  template <class Enum>
  void choice(std::string_view name, Enum& value,
              std::initializer_list<std::pair<std::string_view, std::common_type_t<Enum>>> choices,
              std::string_view doc) {
    OptionChoice choice;
    std::vector<Enum> values;
    for (const auto& [text, meaning] : choices) {
      choice.names.emplace_back(text);
      values.push_back(meaning);
    }
    choice.get = [&value, values] {
      std::size_t index = 0;
      while (index < values.size() && values[index] != value) ++index;
      return index;
    };
    choice.set = [&value, values](std::size_t index) { value = values.at(index); };
    add(name, doc, std::move(choice));
  }
  template <class Struct>
  void section(std::string_view name, Struct& value, std::string_view doc);
  template <class Struct>
  void list(std::string_view name, std::vector<Struct>& values, std::string_view doc);

  OptionFields take() { return std::move(fields_); }

 private:
  template <class Int>
  static bool fits(std::int64_t value) {
    return static_cast<std::int64_t>(static_cast<Int>(value)) == value && (value >= 0 || std::is_signed_v<Int>);
  }
  void add(std::string_view name, std::string_view doc, decltype(Option::as) as);
  OptionFields fields_;
};

template <class Options>
OptionFields fields_of(Options& options) {
  OptionVisitor visitor;
  options.describe(visitor);
  return visitor.take();
}

template <class Struct>
void OptionVisitor::section(std::string_view name, Struct& value, std::string_view doc) {
  add(name, doc, OptionSection{fields_of(value)});
}

template <class Struct>
void OptionVisitor::list(std::string_view name, std::vector<Struct>& values, std::string_view doc) {
  add(name, doc,
      OptionList{[&values] { return values.size(); }, [&values](std::size_t size) { values.resize(size); },
                 [&values](std::size_t index) { return fields_of(values.at(index)); },
                 [sample = std::make_shared<Struct>()] { return fields_of(*sample); }});
}

struct ConfigurationSources {
  std::vector<std::filesystem::path> files;
  // Variables whose names begin with MAPWEAVE_; others are ignored. MAPWEAVE_LASER__GRAPH__MIN_SCORE is
  // laser.graph.min_score: small letters, two underscores for a dot. MAPWEAVE_DATA is reserved and ignored.
  std::vector<std::pair<std::string, std::string>> environment;
  // "laser.graph.min_score=0.5", "robots.0.edge=north" (or "robots[0].edge=north"). The value is YAML.
  std::vector<std::string> settings;
};

// The environment of this process, sorted: for ConfigurationSources::environment.
std::vector<std::pair<std::string, std::string>> process_environment();

// Where values came from, for messages about values that do not go together. Keys as in settings.
class Origins {
 public:
  struct Origin {
    std::string place;           // "configs/edge_robot.yaml:14", "--set seed=3", "environment variable MAPWEAVE_SEED"
    std::filesystem::path file;  // empty unless from a file: what relative paths in the value are relative to
  };
  // Of the key, or of the nearest section or list around it that was given; empty text and path for a default.
  std::string place_of(std::string_view key) const { return origin_of(key).place; }
  std::filesystem::path file_of(std::string_view key) const { return origin_of(key).file; }
  bool is_given(std::string_view key) const;  // itself, not what is around it

  void set(const std::string& key, Origin origin) { origins_[key] = std::move(origin); }
  void forget_below(const std::string& key);  // what a list held before it was replaced

 private:
  Origin origin_of(std::string_view key) const;
  std::map<std::string, Origin> origins_;
};

// Untyped forms of the functions below.
Origins load_fields(OptionFields fields, const ConfigurationSources&);
void override_fields(OptionFields fields, const std::vector<OptionSetting>&);
void check_fields(const OptionFields&);
std::string yaml_of_fields(const OptionFields&);
std::string reference_of_fields(const OptionFields&, std::string_view title);
std::vector<std::string> changed_keys_of_fields(const OptionFields& before, const OptionFields& after);

// Puts all layers over what `options` holds. Throws Error: kMissing for a file that cannot be read, kBadInput for a
// file or the environment, kUsage for a setting: malformed YAML, an unknown key (naming the nearest one), a key twice,
// a value of another type or out of range. Then `options` is unchanged.
template <class Options>
Origins load(Options& options, const ConfigurationSources& sources) {
  Options loaded = options;
  Origins origins = load_fields(fields_of(loaded), sources);
  options = std::move(loaded);
  return origins;
}

// Puts what one element says over what all have. Throws Error kBadInput, as load() does, naming where it was said.
template <class Options>
void override_options(Options& options, const std::vector<OptionSetting>& settings) {
  override_fields(fields_of(options), settings);
}

// Throws Error kBadInput when a value is out of its range: for options that were set in code.
template <class Options>
void check(Options options) {
  check_fields(fields_of(options));
}

// All options, as YAML that loads to the same values to the last bit. The same options give the same text.
template <class Options>
std::string to_yaml(Options options) {
  return yaml_of_fields(fields_of(options));
}

// Keys, as in settings, of what is not alike in two of them; a list as a whole.
template <class Options>
std::vector<std::string> changed_keys(Options before, Options after) {
  return changed_keys_of_fields(fields_of(before), fields_of(after));
}

// As to_yaml, with the meaning and range of each option as comments and an example of a list's element.
template <class Options>
std::string reference_page(Options defaults, std::string_view title) {
  return reference_of_fields(fields_of(defaults), title);
}

}  // namespace mapweave
