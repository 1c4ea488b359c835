#include "numbered_wire.h"
#include "on_board.h"
#include "sharing_cameras.h"

#include "robots/unit_notes.h"

#include <mapweave/core/error.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/core/log.h>
#include <mapweave/rawlog/observation_stream.h>
#include <mapweave/runtime/live_robot.h>
#include <mapweave/runtime/manifest.h>
#include <mapweave/tiers/robot_agent.h>
#include <mapweave/tiers/subjects.h>

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <thread>
#include <utility>

namespace mapweave::runtime {
namespace {

constexpr std::chrono::milliseconds kStep{20};
constexpr std::int64_t kMoment_ns = 50'000'000;           // of data, that a robot maps on board at a time
constexpr std::size_t kReadAhead = std::size_t{4} << 20;  // bytes, where the edge sets the pace

std::string sensor_of(const PlannedRobot& planned) {
  if (planned.sensors.scans != nullptr) return std::string(planned.sensors.scans->name);
  return planned.sensors.cameras.empty() ? "laser" : "camera";
}

using Anchor = std::optional<std::pair<Stamp, Clock::time_point>>;  // when something was said

Clock::time_point due_at(Stamp stamp, const Anchor& anchor, double speed) {
  return anchor->second + std::chrono::duration_cast<Clock::duration>(
                              std::chrono::duration<double>(seconds_between(anchor->first, stamp) / speed));
}

}  // namespace

struct LiveRobot::State {
  const PlannedRobot robot;
  const RunConfiguration& configuration;
  const ConnectToEdge connect;
  const SensorId sensor;
  const bool is_coordinated;

  mutable std::mutex mutex;
  const std::shared_ptr<std::condition_variable> woken = std::make_shared<std::condition_variable>();
  std::condition_variable& changed = *woken;  // channels may outlive the robot
  LiveOptions options;
  std::optional<NumberedWire> wire;  // once it is known which run this is
  std::optional<std::int64_t> run;
  TierId edge;                    // of the wire
  std::uint64_t plan = 0;         // that it follows
  bool is_released = false;       // by the coordinator
  std::uint64_t sensed = 0;       // records, the most that were ever read
  std::uint64_t sent_before = 0;  // bytes, to edges before
  LiveRobotCounts counts;
  bool begins_again = false, ends = false;
  std::atomic<bool> gives_up{false};
  std::vector<Sensed> mapped;             // of the reader: what it mapped on board, to be said
  std::optional<SharingCameras> sharing;  // where its cameras share while they drive
  std::thread reader, speaker;

  State(const PlannedRobot& planned, const RunConfiguration& all, const LiveOptions& live, ConnectToEdge to_edge,
        const ConnectCamera& to_camera_map_server)
      : robot(planned),
        configuration(configuration_of(all, planned)),
        connect(std::move(to_edge)),
        sensor(sensor_of(planned)),
        is_coordinated(all.coordinator.method.has_value()),
        options(live),
        edge(planned.edge),
        agreement(agreement_of(all)) {
    if (!shares_cameras(configuration) || planned.sensors.cameras.empty() || !to_camera_map_server) return;
    sharing.emplace(planned.id, configuration, live,
                    [to_camera_map_server, to = edge](int number) { return to_camera_map_server(to, number); });
  }
  const Hash agreement;

  void read();
  void play();
  void play_on_board();
  bool map_on_board();
  bool wait_until_due(Stamp stamp, Anchor& anchor);
  bool say(Sensed message);
  void begin(Stamp first);
  void open_wire();
  void follow(const LivePlan& plan);
  void hurry(std::unique_lock<std::mutex>& lock);
  bool ends_here() const { return ends && counts.records >= sensed; }  // what was sensed is said in any case
  bool is_done() const { return counts.is_read && wire->is_all_confirmed() && (is_released || !is_coordinated); }
  void pace(const Sensed& message, Anchor& anchor);
  void speak();
  std::optional<Error> play_records(tiers::RobotAgent& agent, UnitNotes& units);
  StreamEnd last_word(StreamEnd end, const tiers::RobotAgent& agent, const UnitNotes& units) const;
};

void LiveRobot::State::begin(Stamp first) {
  const std::lock_guard lock(mutex);
  if (wire) return;
  run = first.ns;
  open_wire();
}

void LiveRobot::State::open_wire() {
  if (wire) {
    wire->close();
    sent_before += wire->counts().sent_bytes;
  }
  wire.emplace(SessionId{{robot.id, sensor}, *run}, agreement, "edge " + edge.str(), options.wire,
               WireHooks{[](const Hello&) { return std::uint64_t{0}; }, [](const Said&) {},
                         [this] {
                           wire->begin_anew({{robot.id, sensor}, wire->self().run});
                           begins_again = true;
                           counts.is_read = false;
                           changed.notify_all();
                         }});
  changed.notify_all();
}

void LiveRobot::State::follow(const LivePlan& news) {
  const std::lock_guard lock(mutex);
  if (news.number <= plan) return;
  // A deployment before this one ended with the first plan that this robot sees.
  if (news.is_done && plan == 0) return;
  plan = news.number;
  is_released = news.is_done;
  changed.notify_all();
  const auto place = news.edge_of.find(robot.id);
  if (place == news.edge_of.end() || place->second == edge) return;
  log(LogLevel::info,
      "robot " + robot.id.str() + (edge.empty() ? "" : " leaves edge " + edge.str()) +
          (place->second.empty() ? "; no edge has room for it" : "; it goes to edge " + place->second.str()) +
          " (plan " + std::to_string(plan) + ")");
  counts.moves += edge.empty() ? 0 : 1;
  edge = place->second;
  if (!wire) return;
  open_wire();
  begins_again = true;
  counts.is_read = false;
}

// What was sensed before is read again as fast as the edge takes it.
void LiveRobot::State::hurry(std::unique_lock<std::mutex>& lock) {
  changed.wait(lock, [&] { return begins_again || gives_up || wire->waiting_bytes() < kReadAhead; });
}

// As it was sensed: what the edge has is passed over at once.
void LiveRobot::State::pace(const Sensed& message, Anchor& anchor) {
  std::unique_lock lock(mutex);
  if (counts.records < sensed) return hurry(lock);
  const auto must_stop = [&] { return begins_again || ends || gives_up; };
  if (options.speed > 0.0) {
    if (message.sequence <= wire->confirmed() || !anchor) {
      anchor = {message.stamp, Clock::now()};
      return;
    }
    changed.wait_until(lock, due_at(message.stamp, anchor, options.speed), must_stop);
  } else {
    changed.wait(lock, [&] { return must_stop() || wire->waiting_bytes() < kReadAhead; });
  }
}

// False: the recording is not read on.
bool LiveRobot::State::say(Sensed message) {
  const std::lock_guard lock(mutex);
  if (begins_again || gives_up) return false;
  const bool is_scan = std::holds_alternative<PackedScan>(message.body);
  if (is_scan && counts.records >= sensed && wire->waiting_bytes() >= options.robot_buffer_bytes()) {
    if (counts.lost_scans++ == 0)
      log(LogLevel::warning, "robot " + robot.id.str() + ": edge " + edge.str() + " has not taken " +
                                 std::to_string(options.robot_buffer_kb) +
                                 " kB (live.robot_buffer_kb); scans are lost from now on");
    message.body = LostScan{};
  }
  counts.scans += is_scan ? 1 : 0;
  counts.messages = message.sequence;
  wire->append(tiers::subject::kSensed, encode(message));
  changed.notify_all();
  return !ends_here();
}

std::optional<Error> LiveRobot::State::play_records(tiers::RobotAgent& agent, UnitNotes& units) {
  try {
    if (robot.trouble) throw Error(*robot.trouble);
    auto log = rawlog::open_log(robot.log, configuration.reading);
    if (const auto as_scans = robot.sensors.scans->as_scans) log = as_scans(std::move(log));
    Anchor anchor;
    std::optional<Stamp> first;
    while (const auto record = log->next()) {
      {
        const std::lock_guard lock(mutex);
        if (ends_here() || gives_up || begins_again) return std::nullopt;
        sensed = std::max(sensed, ++counts.records);
      }
      units.add(*record);
      std::optional<Sensed> message = agent.step(*record);  // numbered: it is said
      if (!message) continue;
      units.look_at(*message);
      if (!first) begin(*(first = message->stamp));
      pace(*message, anchor);
      {
        const std::lock_guard lock(mutex);
        counts.recorded_s = seconds_between(*first, message->stamp);
      }
      if (!say(std::move(*message))) return std::nullopt;
    }
    units.finish();
  } catch (const Error& error) {
    log(LogLevel::warning, "robot " + robot.id.str() + ": its log is read no further: " + error.what());
    return error;
  } catch (const Interrupted&) {  // the recording ends there
    const std::lock_guard lock(mutex);
    ends = true;
  }
  return std::nullopt;
}

StreamEnd LiveRobot::State::last_word(StreamEnd end, const tiers::RobotAgent& agent, const UnitNotes& units) const {
  end.notes = units.notes();
  if (const auto note = note_on_packing(robot.id, agent.packer(), configuration.laser)) end.notes.push_back(*note);
  if (counts.lost_scans > 0)
    end.notes.push_back("robot " + robot.id.str() + ": " + std::to_string(counts.lost_scans) +
                        " scans were lost while its edge did not take what it sensed; a larger live.robot_buffer_kb "
                        "keeps more");
  if (end.notes.size() >= kMostNotes) end.notes.resize(kMostNotes - 1);
  try {
    end.log_sha256 = hash_of_input(robot.log);
    end.log = robot.log.string();
  } catch (const Error&) {  // it cannot be read: that is its trouble already
  }
  return end;
}

void LiveRobot::State::play() {
  tiers::RobotAgent agent(robot.id, laser::scan_input_of(configuration.laser), robot.log.string());
  UnitNotes units(robot);
  {
    const std::lock_guard lock(mutex);
    const std::uint64_t moves = counts.moves;
    counts = {};
    counts.moves = moves;
  }
  std::optional<Error> trouble = play_records(agent, units);
  bool is_asked_to_end = false;
  {
    const std::lock_guard lock(mutex);
    if (gives_up || begins_again) return;
    counts.trouble = trouble;
    is_asked_to_end = ends;
  }
  begin({});  // where nothing came
  Sensed end = agent.end(std::move(trouble));
  StreamEnd word = last_word(std::get<StreamEnd>(end.body), agent, units);
  if (is_asked_to_end) word.notes.push_back("robot " + robot.id.str() + ": its recording was ended on request");
  end.body = std::move(word);
  say(std::move(end));
  const std::lock_guard lock(mutex);
  counts.is_read = !begins_again;
}

// False: the recording is not read on.
bool LiveRobot::State::wait_until_due(Stamp stamp, Anchor& anchor) {
  std::unique_lock lock(mutex);
  const auto must_stop = [&] { return ends || gives_up; };
  if (!anchor) anchor = {stamp, Clock::now()};
  if (options.speed > 0.0) changed.wait_until(lock, due_at(stamp, anchor, options.speed), must_stop);
  return !must_stop();
}

// False: nobody wants it any more.
bool LiveRobot::State::map_on_board() {
  OnBoardMapping mapping(robot, configuration);
  Anchor anchor;
  try {
    for (auto next = mapping.next(); next && wait_until_due(*next, anchor); next = mapping.next()) {
      begin(anchor->first);
      const Stamp moment{next->ns + kMoment_ns};
      mapping.advance(moment, gives_up);
      if (sharing) sharing->exchange(mapping.cameras(), moment);
      const std::lock_guard lock(mutex);
      counts.scans = counts.records = mapping.seen();
      counts.recorded_s = seconds_between(anchor->first, *next);
    }
  } catch (const Interrupted&) {  // the recording ends there
    const std::lock_guard lock(mutex);
    ends = true;
  }
  if (gives_up) return false;
  begin({});  // where nothing came
  if (sharing) sharing->finish(mapping.cameras(), gives_up);
  if (gives_up) return false;
  bool is_asked_to_end = false;
  {
    const std::lock_guard lock(mutex);
    is_asked_to_end = ends;
  }
  mapped = mapping.finish(is_asked_to_end, sharing ? sharing->notes() : std::vector<std::string>{});
  const std::lock_guard lock(mutex);
  counts.trouble = mapping.trouble();
  begins_again = false;  // it has said nothing yet
  return true;
}

void LiveRobot::State::play_on_board() {
  if (mapped.empty() && !map_on_board()) return;
  for (const Sensed& message : mapped) say(message);
  const std::lock_guard lock(mutex);
  counts.is_read = !begins_again;
}

void LiveRobot::State::read() {
  const bool is_on_board = maps_on_board(robot, configuration);
  while (true) {
    is_on_board ? play_on_board() : play();
    std::unique_lock lock(mutex);
    changed.wait(lock, [&] { return begins_again || gives_up; });
    if (gives_up) return;
    begins_again = false;
  }
}

void LiveRobot::State::speak() {
  std::unique_lock lock(mutex);
  Clock::time_point said = Clock::now();
  while (!gives_up) {
    if (sharing) {
      lock.unlock();
      sharing->keep_wires();
      lock.lock();
    }
    if (wire && !edge.empty() && !wire->is_open()) {
      const TierId to = edge;
      lock.unlock();
      std::shared_ptr<transport::Channel> channel = connect(to);
      if (channel) channel->set_listener([woken = woken] { woken->notify_all(); });
      lock.lock();
      if (channel && !channel->is_closed() && to == edge) wire->use(std::move(channel));
    }
    if (wire) {
      const auto now = Clock::now();
      const bool was_full = wire->waiting_bytes() >= kReadAhead;
      wire->step(now, false);
      if (wire->is_open() && wire->is_dead(now)) wire->close();  // the next one may get through
      if (was_full || wire->is_all_confirmed()) changed.notify_all();
      if (!wire->is_all_confirmed() && wire->silent_s(now) >= options.patience_s &&
          std::chrono::duration<double>(now - said).count() >= options.patience_s) {
        said = now;
        log(LogLevel::warning, "robot " + robot.id.str() + ": " +
                                   (edge.empty() ? "no edge is there for it" : wire->peer() + " does not answer") +
                                   "; it keeps what it senses and tries again");
      }
    }
    changed.wait_for(lock, kStep);
  }
}

LiveRobot::LiveRobot(const PlannedRobot& robot, const RunConfiguration& configuration, const LiveOptions& options,
                     ConnectToEdge to_edge, ConnectCamera to_camera_map_server)
    : state_(new State(robot, configuration, options, std::move(to_edge), to_camera_map_server)) {
  if (!robot.trouble && robot.sensors.scans == nullptr && robot.sensors.cameras.empty())
    throw Error(ErrorCode::kBadInput, "robot '" + robot.id.str() + "' maps with nothing", robot.log.string(),
                "set sensor: to what its log holds");
  state_->reader = std::thread([state = state_.get()] { state->read(); });
  state_->speaker = std::thread([state = state_.get()] { state->speak(); });
}

LiveRobot::~LiveRobot() {
  leave();
  state_->reader.join();
  state_->speaker.join();
}

void LiveRobot::leave() {
  const std::lock_guard lock(state_->mutex);
  state_->gives_up = true;
  state_->changed.notify_all();
}

void LiveRobot::end() {
  const std::lock_guard lock(state_->mutex);
  state_->ends = true;
  state_->changed.notify_all();
}

void LiveRobot::follow(const LivePlan& plan) { state_->follow(plan); }

void LiveRobot::use(const LiveOptions& options) {
  const std::lock_guard lock(state_->mutex);
  state_->options.take_while_running(options);
}

bool LiveRobot::is_done() const {
  const std::lock_guard lock(state_->mutex);
  return state_->is_done();
}

bool LiveRobot::wait(std::chrono::milliseconds patience) const {
  std::unique_lock lock(state_->mutex);
  return state_->changed.wait_for(lock, patience, [&] { return state_->is_done(); });
}

LiveRobotCounts LiveRobot::counts() const {
  const std::lock_guard lock(state_->mutex);
  LiveRobotCounts counts = state_->counts;
  counts.is_on_board = maps_on_board(state_->robot, state_->configuration);
  counts.edge = state_->edge;
  counts.is_released = state_->is_released || !state_->is_coordinated;
  if (state_->sharing) counts.sharing = state_->sharing->counts();
  if (!state_->wire) return counts;
  counts.confirmed = state_->wire->confirmed();
  counts.waiting_bytes = state_->wire->waiting_bytes();
  counts.sent_bytes = state_->sent_before + state_->wire->counts().sent_bytes;
  counts.bytes_per_s = state_->wire->bytes_per_s();
  counts.wire = state_->wire->health();
  counts.is_edge_on_wire = state_->wire->is_open() && state_->wire->is_welcome();
  counts.silent_s = state_->wire->silent_s(Clock::now());
  counts.refusal = state_->wire->refusal();
  return counts;
}

}  // namespace mapweave::runtime
