// mapweave worker: does tasks of runs, one after another, until it is stopped.

#include "command.h"
#include "command_line.h"
#include "stop_signals.h"
#include "workers.h"

#include <mapweave/core/error.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/core/log.h>

#include <unistd.h>
#include <nlohmann/json.hpp>

#include <memory>
#include <thread>

namespace mapweave::app {
namespace {

using namespace std::chrono_literals;

constexpr auto kPatience = 10s, kFresh = 10s, kSay = 2s;
constexpr auto kStep = 20ms;

runtime::LiveOptions at(runtime::LiveOptions live, const std::string& broker) {
  live.broker = broker;
  return live;
}

// A machine may have several, one a processor.
std::string name_here() {
  char host[256] = {};
  if (::gethostname(host, sizeof host - 1) != 0) return "worker-" + std::to_string(::getpid());
  std::string name(host);
  for (char& letter : name)
    if (std::isalnum(static_cast<unsigned char>(letter)) == 0 && letter != '-') letter = '-';
  return name + "-" + std::to_string(::getpid());
}

struct Arguments {
  std::string cluster, name;
  std::filesystem::path logs, keys;
  bool unprotected = false;
};

ExitCode work(const Arguments& arguments) {
  StopSignals signals;
  runtime::RunConfiguration configuration;
  configuration.live.broker = arguments.cluster;
  configuration.live.keys = arguments.keys.string();
  configuration.live.unprotected = arguments.unprotected;
  const runtime::NatsWires wires(configuration, kPatience);
  const std::string name = arguments.name.empty() ? name_here() : arguments.name;
  transport::NatsBoard board = wires.board_of_workers();
  board.ensure(kPatience);
  runtime::Worker worker(name, wires.at_worker(name), arguments.logs);
  log(LogLevel::info, "worker " + name + " waits for runs at " + arguments.cluster);
  auto next = std::chrono::steady_clock::now();
  bool was_busy = false, is_stopped = false;
  while (!is_stopped) {
    worker.step();
    if (const auto now = std::chrono::steady_clock::now(); now >= next || worker.is_busy() != was_busy) {
      next = now + kSay;
      was_busy = worker.is_busy();
      board.put(name, nlohmann::json{{"worker", name}, {"is_busy", was_busy}}.dump());
    }
    is_stopped = signals.wait(kStep);
  }
  board.put(name, nlohmann::json{{"worker", name}, {"is_busy", true}}.dump());
  const runtime::Worker::Counts counts = worker.counts();
  log(LogLevel::info, "worker " + name + " ends: " + std::to_string(counts.mapped) + " robots mapped, " +
                          std::to_string(counts.judged) + " tasks judged, " + std::to_string(counts.drawn) +
                          " dense maps made" +
                          (counts.failed > 0 ? ", " + std::to_string(counts.failed) + " could not be done" : "") +
                          (worker.is_busy() ? "; left to another worker: " + counts.task : ""));
  std::this_thread::sleep_for(200ms);  // that it is gone
  return ExitCode::done;
}

}  // namespace

WorkersOfCluster::WorkersOfCluster(const runtime::RunConfiguration& configuration, const std::string& broker)
    : wires_(configuration, at(configuration.live, broker), kPatience), board_(wires_.board_of_workers()) {
  board_.ensure(kPatience);
  cluster_.patience_s = configuration.live.patience_s;
  cluster_.open = [this](const std::string& worker) { return wires_.to_worker(worker)(); };
  cluster_.idle_workers = [this] {
    std::vector<std::string> idle;
    for (const transport::NatsBoard::Word& word : board_.words(kPatience)) {
      const nlohmann::json said = nlohmann::json::parse(word.bytes, nullptr, false);
      if (!said.is_object() || !said.contains("worker") || !said["worker"].is_string()) continue;
      const auto name = said["worker"].get<std::string>();
      // A worker is there while its word is renewed: machines' clocks may differ.
      const auto now = std::chrono::steady_clock::now();
      const auto [known, is_new] = words_.try_emplace(name, LastWord{word.stored, std::nullopt});
      if (!is_new && known->second.said != word.stored) known->second = {word.stored, now};
      if (!said.value("is_busy", true) && known->second.renewed && now - *known->second.renewed < kFresh)
        idle.push_back(name);
    }
    return idle;
  };
}

Action set_up_worker(CLI::App& verb) {
  const auto arguments = std::make_shared<Arguments>();
  verb.add_option("--cluster", arguments->cluster, "NATS server with JetStream where runs ask for workers")
      ->required()
      ->type_name("URL");
  verb.add_option("--name", arguments->name, "what this worker is called; empty: the machine's name and a number")
      ->type_name("NAME");
  verb.add_option("--logs", arguments->logs,
                  "folder in which robots' logs lie here, by their names; others are at the path that the run has")
      ->type_name("DIR");
  verb.add_option("--keys", arguments->keys, "file of keys that `mapweave serve keys` made: worker.keys")
      ->type_name("FILE");
  verb.add_flag("--unprotected", arguments->unprotected,
                "talk to a server on another machine without keys: whoever reaches it can read all maps");
  return [arguments] { return work(*arguments); };
}

}  // namespace mapweave::app
