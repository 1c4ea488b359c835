// mapweave serve coordinator: which robot's data go to which edge, decided again and again while they drive.

#include "configuration_reload.h"
#include "service_notify.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/core/log.h>
#include <mapweave/runtime/deployment_keys.h>
#include <mapweave/runtime/json_text.h>
#include <mapweave/runtime/live_coordinator.h>

#include <algorithm>
#include <mutex>
#include <optional>
#include <utility>

namespace mapweave::app {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

constexpr auto kStep = 50ms;
constexpr auto kBetweenLooks = 1s;
constexpr auto kPatience = 2s;  // of one question to the broker
constexpr auto kToConnect = 20s;
constexpr std::size_t kMostMapBytes = std::size_t{250} << 10;  // of one word at the board
constexpr char kName[] = "coordinator";

double seconds(Clock::duration duration) { return std::chrono::duration<double>(duration).count(); }

std::optional<runtime::LivePlan> last_plan(const transport::Board& plans, std::chrono::milliseconds patience) {
  const auto word = plans.last(kName, patience);
  if (!word) return std::nullopt;
  return runtime::decode_live_plan(word->bytes, "the coordinator's plan");
}

// Time in which the broker answers: nobody is missed while nothing could be received.
class AnsweredTime {
 public:
  double now_s() const { return now_s_; }
  void answered() {
    const auto now = Clock::now();
    now_s_ += std::min(seconds(now - std::exchange(last_, now)), kMost_s);
  }

 private:
  static constexpr double kMost_s = 3.0;
  double now_s_ = 0.0;
  Clock::time_point last_ = Clock::now();
};

// One turn: receives what all say, decides, says the plan.
class Coordination {
 public:
  Coordination(const Deployment& deployment, const runtime::Wires& wires, std::filesystem::path out, Progress& progress)
      : plan_(deployment.plan),
        status_(wires.board()),
        plans_(wires.plans()),
        out_(std::move(out)),
        progress_(progress) {
    plans_->ensure(kToConnect);
    coordinator_.emplace(deployment.loaded.configuration, deployment.plan, last_plan(*plans_, kToConnect));
    write();
  }

  runtime::LiveCoordinator& coordinator() { return *coordinator_; }
  double now_s() const {
    const std::lock_guard lock(mutex_);
    return time_.now_s();
  }

  void look() {
    try {
      receive();
      const double now_s = advance();
      const bool is_new = coordinator_->step(now_s);
      const runtime::LivePlan plan = coordinator_->plan();
      if (plan.number > 0 && (is_new || Clock::now() >= say_again_)) say(plan);
      if (is_new) show(plan);
      if (is_new || Clock::now() >= write_again_) write();
    } catch (const Error& error) {
      if (error.code() != ErrorCode::kMissing) throw;
      log(LogLevel::debug, "the broker does not answer: " + std::string(error.what()));
    }
  }

 private:
  double advance() {
    const std::lock_guard lock(mutex_);
    time_.answered();
    return time_.now_s();
  }

  template <class Receive>
  void receive(const std::string& user, Receive&& receive_it) {
    if (const auto word = status_->last(user, kPatience)) receive_it(word->bytes);
  }

  void receive() {
    const double now_s = this->now_s();
    receive("cloud", [&](const std::string& word) { coordinator_->receive_cloud(word, now_s); });
    for (const TierId& edge : plan_.edges) {
      receive("edge-" + edge.str(), [&](const std::string& word) { coordinator_->receive_edge(edge, word, now_s); });
      receive(runtime::maps_word_of(edge), [&](const std::string& word) { coordinator_->receive_maps(edge, word); });
    }
    for (const runtime::PlannedRobot& robot : plan_.robots)
      receive("robot-" + robot.id.str(),
              [&](const std::string& word) { coordinator_->receive_robot(robot.id, word, now_s); });
  }

  void say(const runtime::LivePlan& plan) {
    const auto there = last_plan(*plans_, kPatience);
    if (there && (there->number > plan.number || (there->number == plan.number && encode(*there) != encode(plan))))
      throw Error(ErrorCode::kBadInput, "another coordinator of this deployment is at work", {},
                  "let one of the two run");
    plans_->put(kName, encode(plan));
    say_again_ = Clock::now() + 2 * kBetweenLooks;
  }

  void show(const runtime::LivePlan& plan) {
    const runtime::LiveCoordinatorCounts counts = coordinator_->counts(now_s());
    if (counts.moves != moves_) progress_.say("plan " + std::to_string(plan.number) + " " + counts.last);
    moves_ = counts.moves;
    if (plan.is_final && !std::exchange(is_final_, true))
      progress_.say("all robots have ended; edges merge for good, and the cloud after them");
  }

  void write() {
    write_file(out_ / "plan.json", runtime::json_text(coordinator_->report()) + "\n");
    write_again_ = Clock::now() + 10 * kBetweenLooks;
  }

  const runtime::RunPlan& plan_;
  const std::shared_ptr<transport::Board> status_;
  const std::shared_ptr<transport::Board> plans_;
  const std::filesystem::path out_;
  Progress& progress_;
  std::optional<runtime::LiveCoordinator> coordinator_;
  mutable std::mutex mutex_;
  AnsweredTime time_;
  std::uint64_t moves_ = 0;
  bool is_final_ = false;
  Clock::time_point say_again_{}, write_again_{};
};

ServiceTurn service_turn_of(const runtime::LiveCoordinatorCounts& counts) {
  ServiceTurn turn;
  const auto there =
      std::count_if(counts.edges.begin(), counts.edges.end(), [](const auto& one) { return one.is_there; });
  const auto come =
      std::count_if(counts.robots.begin(), counts.robots.end(), [](const auto& one) { return one.has_come; });
  turn.status = "plan " + std::to_string(counts.plan.number) + ", " + std::to_string(there) + " of " +
                std::to_string(counts.edges.size()) + " edges, " + std::to_string(come) + " of " +
                std::to_string(counts.robots.size()) + " robots, " + std::to_string(counts.moves) + " moves";
  return turn;
}

}  // namespace

bool is_coordinated(const Deployment& deployment) {
  return deployment.loaded.configuration.coordinator.method.has_value();
}

std::optional<runtime::LivePlan> PlanReader::look() {
  const auto now = Clock::now();
  if (!is_coordinated_ || now < next_) return std::nullopt;
  next_ = now + kBetweenLooks;
  try {
    std::optional<runtime::LivePlan> plan = last_plan(*plans_, kPatience);
    if (!plan || plan->number <= number_) return std::nullopt;
    expect_of(*plan, of_);
    number_ = plan->number;
    return plan;
  } catch (const Error& error) {
    if (error.code() != ErrorCode::kMissing && !std::exchange(has_warned_, true))
      log(LogLevel::warning, "the coordinator's plan cannot be followed: " + std::string(error.what()));
    return std::nullopt;
  }
}

void MapReportPublisher::publish(const runtime::LiveEdge& edge) {
  constexpr auto kAgain = 30s;  // where somebody deleted the stream
  const auto now = Clock::now();
  if (now < next_) return;
  next_ = now + kBetweenLooks;
  const std::vector<std::string> reports = edge.map_reports();
  std::string word = runtime::pack_map_reports(reports, kMostMapBytes);
  if (reports.empty() || (word == said_ && now < again_)) return;
  again_ = now + kAgain;
  if (board_->put(name_, word)) said_ = std::move(word);
}

ExitCode serve_coordinator(const RoleArguments& arguments, RoleExtension& extension) {
  StopSignals signals(StopSignals::OnHangup::reload);
  const Deployment deployment = load_deployment(arguments.file, arguments.flags);
  const std::filesystem::path& out = arguments.flags.out;
  if (!is_coordinated(deployment))
    throw Error(ErrorCode::kBadInput, "the configuration has no coordinator", "coordinator.method",
                "set how it groups robots: coordinator: {method: default}");
  RunningSince since(deployment.live());
  make_folder(out, "name another one in --out");
  const auto progress = make_terminal_progress();
  extension.begin(deployment, kName, signals);
  const std::unique_ptr<runtime::Wires> wires = extension.wires(deployment, std::nullopt);
  Coordination coordination(deployment, *wires, out, *progress);
  const TierEnd tier_end(extension);
  runtime::LiveCoordinator& coordinator = coordination.coordinator();
  const auto status = [&] {
    const runtime::StatusTerms terms = since.terms();
    return runtime::program_status(kName, kName, {tier_status(coordinator.counts(coordination.now_s()), terms)}, terms);
  };
  runtime::PageSource source = page_of("mapweave serve coordinator", deployment.loaded.configuration, deployment.plan);
  source.status = status;
  source.preview = [] { return nullptr; };
  LivePage page(std::move(source), deployment.live(), *progress);
  ConfigurationReload reload(arguments, deployment, signals);
  StatusPublisher publisher(*wires, kName, true, status);
  progress->say("the coordinator writes its plans to " + (out / "plan.json").string());
  ServiceNotifier service;
  Clock::time_point next{};
  while (!coordinator.plan().is_done) {
    if (extension.look(coordinator, status)) {
      coordinator.decide_soon();
      next = {};
    }
    if (Clock::now() >= next) {
      coordination.look();
      next = Clock::now() + kBetweenLooks;
    }
    publisher.publish();
    if (const auto live = reload.look()) {
      coordinator.use(*live);
      page.use(*live);
      since.use(*live);
    }
    service.turn(service_turn_of(coordinator.counts(coordination.now_s())));
    if (signals.wait(kStep))
      throw Interrupted("interrupted; the coordinator goes on with its plan when it is started again");
  }
  publisher.publish(true);
  progress->say("the cloud has written the team's map");
  return ExitCode::done;
}

}  // namespace mapweave::app
