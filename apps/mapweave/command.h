#pragma once
// One program, many verbs: each verb is a file of this folder and a line in main.cpp's table.

#include <mapweave/core/exit_code.h>

#include <CLI/CLI.hpp>

#include <cstdint>
#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace mapweave::app {

// Carries out a verb; returns the exit code (README, verbs).
using Action = std::function<ExitCode()>;

struct Command {
  const char* name;
  const char* summary;
  const char* example;               // shown under the verb's help
  Action (*set_up)(CLI::App& verb);  // declares the verb's arguments; the action reads them after parsing
};

// Flags that all verbs which compute and write share.
struct WritingFlags {
  std::filesystem::path out;
  int threads = 0;  // 0: as many as there are processors
  std::optional<std::uint64_t> seed;
  std::vector<std::string> set;  // key=value
  bool force = false, json = false;
};
void add_writing_flags(CLI::App& verb, WritingFlags&);
int threads_of(const WritingFlags&);

Action set_up_doctor(CLI::App&);
Action set_up_run(CLI::App&);
Action set_up_worker(CLI::App&);
Action set_up_serve(CLI::App&);
Action set_up_slam(CLI::App&);
Action set_up_merge(CLI::App&);
Action set_up_split(CLI::App&);
Action set_up_convert(CLI::App&);
Action set_up_simulate(CLI::App&);
Action set_up_inspect(CLI::App&);
Action set_up_export(CLI::App&);
Action set_up_evaluate(CLI::App&);
Action set_up_explain(CLI::App&);
Action set_up_report(CLI::App&);
Action set_up_plan(CLI::App&);
Action set_up_profile(CLI::App&);
Action set_up_timeline(CLI::App&);
Action set_up_vocabulary(CLI::App&);
Action set_up_config(CLI::App&);

}  // namespace mapweave::app
