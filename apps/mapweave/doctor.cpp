// mapweave doctor: is everything there, and who of a deployment waits for what?

#include "command.h"
#include "command_line.h"
#include "serve.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/core/format.h>
#include <mapweave/runtime/manifest.h>
#include <mapweave/runtime/nats_wires.h>
#include <mapweave/transport/broker.h>

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <iostream>
#include <memory>
#include <thread>

namespace mapweave::app {
namespace {

using Json = nlohmann::ordered_json;
using namespace std::chrono_literals;

constexpr auto kPatience = 5s;  // of one question to the broker
constexpr auto kBetween = 3s;   // two looks, for rates
constexpr double kMostClockOffset_s = 1.0;

struct Arguments {
  std::filesystem::path file;
  WritingFlags flags;
};

Json finding(const char* level, const std::string& what, const std::string& remedy) {
  return {{"level", level}, {"what", what}, {"remedy", remedy}};
}

Json look_here() {
  constexpr std::uintmax_t kEnough = std::uintmax_t{1} << 30;
  Json findings = Json::array();
  try {
    transport::find_broker();
  } catch (const Error& error) {
    findings.push_back(finding("warning", error.problem() + ": serve demo needs one", error.remedy()));
  }
  std::error_code error;
  const std::filesystem::path temporary = std::filesystem::temp_directory_path(error);
  if (error || ::access(temporary.c_str(), W_OK) != 0)
    findings.push_back(
        finding("error", "nothing can be written to " + temporary.string(), "name another folder in TMPDIR"));
  const auto space = std::filesystem::space(temporary, error);
  if (!error && space.available < kEnough)
    findings.push_back(
        finding("warning",
                format("only %.0f MB are free in %s", 1e-6 * static_cast<double>(space.available), temporary.c_str()),
                "make room, or name another folder in TMPDIR"));
  return findings;
}

// One program as it said last. What it says came over the wire, and may be of any shape.
struct Word {
  Json status;
  double age_s = 0.0, clock_offset_s = 0.0;  // against the broker's clock
};

std::optional<Word> last_word(const transport::Board& board, const std::string& user,
                              std::chrono::system_clock::time_point now) {
  const auto word = board.last(user, kPatience);
  if (!word) return std::nullopt;
  constexpr std::int64_t kMost_ns = std::int64_t{4} << 60;  // of which differences are no overflow
  Json status = Json::parse(word->bytes, nullptr, false);
  const auto at_ns = status.is_object() ? status.find("said_at_ns") : status.end();
  const std::int64_t said_ns = at_ns != status.end() && at_ns->is_number_integer() ? at_ns->get<std::int64_t>() : 0;
  const auto seconds = [](auto duration) { return std::chrono::duration<double>(duration).count(); };
  const std::chrono::system_clock::time_point said{std::chrono::duration_cast<std::chrono::system_clock::duration>(
      std::chrono::nanoseconds(std::clamp(said_ns, std::int64_t{0}, kMost_ns)))};
  return Word{std::move(status), seconds(now - word->stored), seconds(said - word->stored)};
}

// By the broker's clock: what the doctor says itself, and reads again.
std::chrono::system_clock::duration broker_is_ahead(transport::Board& board) {
  board.ensure(kPatience);
  board.put("doctor", "looks");
  const auto said = std::chrono::system_clock::now();
  for (int i = 0; i < 50; ++i) {
    if (const auto word = board.last("doctor", kPatience); word && word->bytes == "looks") return word->stored - said;
    std::this_thread::sleep_for(100ms);
  }
  return {};
}

// Counts of one tier a second, between two looks; of those that did not begin again in between, as a robot's do that
// changes edges.
Json rates_of(const Json& before, const Json& after) {
  Json rates = Json::object();
  const double seconds = after.value("up_seconds", 0.0) - before.value("up_seconds", 0.0);
  if (seconds <= 0.0) return rates;
  const auto add = [&](const Json& first, const Json& second, const std::string& prefix) {
    for (const char* name : {"scans", "messages", "taken", "mapped", "sent_bytes"})
      if (second.contains(name) && first.contains(name) && first[name].is_number() && second[name].is_number() &&
          first[name] <= second[name])
        rates[prefix + name] = (second[name].get<double>() - first[name].get<double>()) / seconds;
  };
  const Json &one = before.at("tiers").at(0), &two = after.at("tiers").at(0);
  add(one.value("counts", Json::object()), two.value("counts", Json::object()), "");
  for (const Json& link : two.value("links", Json::array()))
    for (const Json& known : one.value("links", Json::array()))
      if (known.value("name", "") == link.value("name", ""))
        add(known.value("counts", Json::object()), link.value("counts", Json::object()), link.value("name", "") + ".");
  return rates;
}

Json look_at_program(const std::string& user, const std::optional<Word>& before, const std::optional<Word>& after,
                     double patience_s) {
  Json seen = {{"program", user}, {"silent_seconds", nullptr}, {"findings", Json::array()}};
  const auto find = [&](const char* level, const std::string& what, const std::string& remedy) {
    seen["findings"].push_back(finding(level, what, remedy));
  };
  const std::string start = "start it: mapweave serve " + (user == "cloud" || user == "coordinator"
                                                               ? user + " CONFIG --out DIR"
                                                               : user.substr(0, user.find('-')) + " CONFIG --name " +
                                                                     user.substr(user.find('-') + 1));
  if (!after) {
    find("error", "it never said anything", start);
    return seen;
  }
  const Json& tier = after->status.at("tiers").at(0);
  seen["silent_seconds"] = after->age_s;
  seen["clock_offset_seconds"] = after->clock_offset_s;
  seen["rates"] = before ? rates_of(before->status, after->status) : Json::object();
  seen["status"] = after->status;
  const bool is_done = tier.value("is_done", false);
  if (!is_done && after->age_s > patience_s)
    find("error", format("it said something last %.0f s ago", after->age_s), "look whether it runs; else " + start);
  if (std::abs(after->clock_offset_s) > kMostClockOffset_s)
    find("warning",
         format("its clock is %.1f s %s the broker's", std::abs(after->clock_offset_s),
                after->clock_offset_s < 0.0 ? "behind" : "ahead of"),
         "set the clocks of all machines by NTP");
  if (after->status.value("version", "") != runtime::program_version())
    find("warning",
         "it is version " + after->status.value("version", "?") + ", this one is " + runtime::program_version(),
         "give all programs the same version");
  if (!is_done)
    for (const Json& one : tier.value("findings", Json::array())) seen["findings"].push_back(one);
  return seen;
}

// One end of a wire: "  robot alpha: on the wire; said something 0 s ago; 5.1 messages/s; 2 missed".
std::string wire_in_words(const Json& link, const Json& rates) {
  const std::string name = link.value("name", ""), role = link.value("role", "");
  std::string text = "\n  " + role + (name == role ? "" : " " + name) + ": " +
                     (link.value("is_on_wire", false) ? "on the wire" : "not on the wire");
  if (const auto silent = link.find("silent_seconds"); silent != link.end() && silent->is_number())
    text += format("; said something %.0f s ago", silent->get<double>());
  if (rates.contains(name + ".taken")) text += format("; %.1f messages/s", rates[name + ".taken"].get<double>());
  const Json counts = link.value("counts", Json::object());
  const auto add = [&](const char* count, const char* words) {
    if (counts.contains(count) && counts[count] > 0) text += "; " + counts[count].dump() + words;
  };
  add("queue_bytes", " bytes to be mapped");
  add("wire_missed", " messages missed");
  add("wire_sent_again", " parts sent again");
  add("wire_refused", " parts that are no messages");
  if (const auto speed = counts.find("bytes_per_second"); speed != counts.end() && speed->is_number())
    text += format("; carries %.0f kB/s", 1e-3 * speed->get<double>());
  return text;
}

std::string in_words(const Json& seen) {
  std::string text = seen["program"].get<std::string>() + ": ";
  if (seen["silent_seconds"].is_null()) return text + seen["findings"].at(0).at("what").get<std::string>();
  const Json& tier = seen["status"].at("tiers").at(0);
  text += format("said something %.0f s ago; ", seen["silent_seconds"].get<double>()) + tier.value("state", "") +
          format("; its clock %+.2f s", seen["clock_offset_seconds"].get<double>());
  const Json counts = tier.value("counts", Json::object());
  const auto add = [&](const char* name, const char* words) {
    if (counts.contains(name)) text += "; " + counts[name].dump() + words;
  };
  add("scans", " scans");
  if (seen["rates"].contains("scans")) text += format(" (%.1f/s)", seen["rates"]["scans"].get<double>());
  add("lost_scans", " lost");
  add("waiting_bytes", " bytes wait");
  add("preview_maps", " maps in its preview");
  if (counts.contains("plan")) text += "; plan " + counts["plan"].dump();
  for (const Json& link : tier.value("links", Json::array())) text += wire_in_words(link, seen["rates"]);
  const Json groups = tier.value("groups", Json::object());
  for (const auto& [edge, robots] : groups.items()) {
    text += "\n  edge " + edge + ":";
    for (const Json& robot : robots) text += " " + robot.get<std::string>();
    if (robots.empty()) text += " none";
  }
  if (const std::string last = tier.value("last", ""); !last.empty()) text += "\n  moved last " + last;
  for (const Json& group : tier.value("joint", Json::array())) {
    text += "; joined: ";
    for (std::size_t i = 0; i < group.size(); ++i) text += (i > 0 ? " + " : "") + group[i].get<std::string>();
  }
  for (const Json& pair : tier.value("apart", Json::array())) text += "\n  apart: " + pair.get<std::string>();
  return text;
}

std::string in_lines(const Json& findings) {
  std::string text;
  for (const Json& one : findings)
    text += "  " + one.value("level", "") + ": " + one.value("what", "") + "; " + one.value("remedy", "") + "\n";
  return text;
}

// Without what would change a terminal.
std::string printable(std::string text) {
  std::replace_if(
      text.begin(), text.end(), [](char c) { return (c >= 0 && c < ' ' && c != '\n') || c == '\x7f'; }, '?');
  return text;
}

// With `text`, as it is printed.
Json seen_and_described(const std::string& user, const std::optional<Word>& before, const std::optional<Word>& after,
                        double patience_s) {
  Json seen;
  try {
    seen = look_at_program(user, before, after, patience_s);
    seen["text"] = printable(in_words(seen) + "\n" + in_lines(seen["findings"]));
  } catch (const Json::exception&) {
    seen = {{"program", user},
            {"silent_seconds", nullptr},
            {"findings",
             {finding("error", "what it says of itself cannot be read",
                      "give all programs the same version; look who else writes under its name")}}};
    seen["text"] = in_words(seen) + "\n" + in_lines(seen["findings"]);
  }
  return seen;
}

struct Program {
  std::string user;
  std::optional<TierId> edge;  // at whose broker it is
};

std::vector<Program> programs_of(const Deployment& deployment) {
  const runtime::RunPlan& plan = deployment.plan;
  std::vector<Program> programs{{"cloud", std::nullopt}};
  if (is_coordinated(deployment)) programs.push_back({"coordinator", std::nullopt});
  for (const TierId& edge : plan.edges) programs.push_back({"edge-" + edge.str(), edge});
  for (const runtime::PlannedRobot& robot : plan.robots) programs.push_back({"robot-" + robot.id.str(), robot.edge});
  return programs;
}

Json look_at_deployment(const Arguments& arguments) {
  const Deployment deployment = load_deployment(arguments.file, arguments.flags);
  const runtime::NatsWires wires(deployment.loaded.configuration, kPatience);
  const std::shared_ptr<transport::Board> board = wires.board();
  const auto ahead = broker_is_ahead(*board);
  const std::vector<Program> programs_there = programs_of(deployment);
  const auto look = [&] {
    std::vector<std::optional<Word>> words;
    for (const Program& program : programs_there) {
      const auto now = std::chrono::system_clock::now() + ahead;
      auto own = program.edge ? wires.board_of(*program.edge) : std::nullopt;
      if (own) try {
          words.push_back(last_word(*own, program.user, now));
          continue;
        } catch (const Error&) {  // the edge's broker is away: as it was said last
        }
      words.push_back(last_word(*board, program.user, now));
    }
    return words;
  };
  const auto before = look();
  std::this_thread::sleep_for(kBetween);
  const auto after = look();
  Json programs = Json::array();
  for (std::size_t i = 0; i < programs_there.size(); ++i)
    programs.push_back(seen_and_described(programs_there[i].user, before[i], after[i], deployment.live().patience_s));
  return {{"broker", deployment.live().broker_url()},
          {"broker_ahead_seconds", std::chrono::duration<double>(ahead).count()},
          {"programs", std::move(programs)}};
}

bool has_error(const Json& findings) {
  for (const Json& one : findings)
    if (one.value("level", "") == "error") return true;
  return false;
}

}  // namespace

Action set_up_doctor(CLI::App& verb) {
  const auto arguments = std::make_shared<Arguments>();
  verb.add_option("CONFIG", arguments->file,
                  "a deployment's configuration; without it, this machine alone is looked at")
      ->type_name("CONFIG.yaml");
  verb.add_option("--set", arguments->flags.set, "sets one option: key=value, as in live.keys=doctor.keys")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);
  verb.add_flag("--json", arguments->flags.json, "print what was found as JSON");
  show_examples(verb, {"mapweave doctor office.yaml"});
  return [=] {
    Json found = {{"version", runtime::program_version()}, {"here", look_here()}};
    if (!arguments->file.empty()) found["deployment"] = look_at_deployment(*arguments);
    bool is_healthy = !has_error(found["here"]);
    const Json programs = found.contains("deployment") ? found["deployment"]["programs"] : Json::array();
    for (const Json& seen : programs) is_healthy = is_healthy && !has_error(seen["findings"]);
    found["is_healthy"] = is_healthy;
    if (arguments->flags.json) {
      std::cout << found.dump(2) << "\n";
    } else {
      std::cout << "mapweave " << runtime::program_version() << " on this machine\n";
      std::cout << in_lines(found["here"]);
      if (found.contains("deployment"))
        std::cout << "broker " << found["deployment"].value("broker", "") << ": answers\n";
      for (const Json& seen : programs) std::cout << seen["text"].get<std::string>();
      std::cout << (is_healthy ? "nothing is wrong\n" : "something needs help\n");
    }
    return is_healthy ? ExitCode::done : ExitCode::gate_failed;
  };
}

}  // namespace mapweave::app
