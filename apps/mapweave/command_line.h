#pragma once
// How the command line speaks: what values may be, what is wrong with them, and help, in our own words.

#include <mapweave/core/error.h>

#include <CLI/CLI.hpp>

#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <vector>

namespace mapweave::app {

// Checks for CLI::Option::check(). Their messages name the value, what it may be, and the nearest name.
CLI::Validator one_of(std::vector<std::string> names);
CLI::Validator whole_number(std::int64_t low, std::int64_t high);
CLI::Validator number(double low = -std::numeric_limits<double>::infinity());  // `low` or more

// Stands at the end of the help, one command a line: "mapweave slam alpha.rawlog --out maps/alpha".
void show_examples(CLI::App&, const std::vector<std::string>& commands);

// To be set before subcommands are added, which take it over.
std::shared_ptr<CLI::Formatter> help_formatter();

// "help slam" is "slam --help".
std::vector<std::string> with_help_as_flag(std::vector<std::string> arguments);

// What the parser found wrong, with the verb, and how to do it right.
Error usage_error(const CLI::App& program, const CLI::ParseError&);

}  // namespace mapweave::app
