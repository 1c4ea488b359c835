#include "channel_end.h"

#include <mapweave/core/little_endian.h>
#include <mapweave/core/log.h>
#include <mapweave/transport/direct_channel.h>

#include <algorithm>
#include <map>
#include <set>
#include <thread>
#include <tuple>

namespace mapweave::transport {
namespace {

constexpr char kPart = 'P', kNote = 'N';
constexpr std::size_t kPartHeader = 10;  // kind, class, token
constexpr std::size_t kNoteEntry = 17;   // class, two numbers
constexpr std::size_t kAcknowledged = 0xFF, kMostEnded = 64, kMostParts = 1 << 16;
constexpr double kTick_s = 0.1, kSayAgain_s = 1.0;

// Session, message, part.
using PartKey = std::tuple<std::uint64_t, std::uint64_t, std::uint32_t>;

ChannelEndOptions end_options_of(const DirectChannelOptions& options) {
  return {options.opens,
          options.priorities,
          {options.priorities.size() + 1, options.limits, options.received.message_bytes, options.confirm_s},
          options.received,
          60.0,
          options.linger_s};
}

}  // namespace

struct DirectChannel::State : ChannelEnd {
  State(DirectChannelOptions given, std::function<void(std::string)> to)
      : ChannelEnd(end_options_of(given), random_session()),
        options(std::move(given)),
        send_packet(std::move(to)),
        in(options.priorities.size() + 1) {}

  void run();
  bool send_parts();
  void take_note(std::string_view note);
  void note_acknowledged();
  void say_note();
  void tick();

  const DirectChannelOptions options;
  const std::function<void(std::string)> send_packet;
  // Of one class, what came: parts have numbers from 1 on.
  struct Incoming {
    std::uint64_t last = 0, acknowledged = 0;  // acknowledged: all up to here
    std::set<std::uint64_t> beyond;            // acknowledged, and not all before them
    std::map<PartKey, std::uint64_t> numbers;  // of those that are not acknowledged
    std::uint64_t confirmed = 0;               // by the other end, of what this one sent: the largest number
    std::vector<std::pair<std::uint64_t, std::uint64_t>> new_parts;  // token and number, not confirmed yet
  };
  std::vector<Incoming> in;  // under the lock
  bool has_news = false;     // for a note
  // Sessions of which this end knows nothing, as it began after them; one of them goes on.
  std::set<std::uint64_t> ended;
  bool ends_again = false;
  double said_s = 0.0, ticked_s = 0.0;
  std::thread thread;
};

// A part is acknowledged by "<class> <number>". One that comes again while it waits has its number already. Of another
// session only the beginning counts, which ends this one, and nothing is confirmed: it is the next channel's.
void DirectChannel::take(std::string_view packet) {
  State& state = *state_;
  if (packet.empty()) return;
  if (packet.front() == kNote) return state.take_note(packet.substr(1));
  if (packet.front() != kPart || packet.size() < kPartHeader) return;
  const std::size_t priority = static_cast<unsigned char>(packet[1]);
  if (priority >= state.in.size()) return;
  const auto token = number_at<std::uint64_t>(packet, 2);
  const std::string_view bytes = packet.substr(kPartHeader);
  const auto decoded = decode_part(bytes);
  const auto* part = std::get_if<WirePart>(&decoded);
  std::uint64_t number = 0;
  State::Incoming& one = state.in[priority];
  {
    const std::lock_guard lock(state.mutex);
    if (state.is_closed()) return;
    if (part != nullptr) {
      const WireHeader& header = part->header;
      if (state.ended.count(header.session) > 0) return void(state.ends_again = true);
      if (state.receiver.session() != 0 && header.session != state.receiver.session()) {
        if (header.kind != WireKind::opens) return;
      } else if (one.numbers.size() >= kMostParts) {
        return;  // it comes again
      } else {
        const auto known = one.numbers.emplace(PartKey{header.session, header.number, part->part}, one.last + 1);
        number = known.first->second;
        if (!known.second) {
          one.new_parts.emplace_back(token, number);
          state.has_news = true;
          return state.stir();
        }
        one.last = number;
      }
    }
  }
  state.ChannelEnd::take(priority, bytes,
                         number == 0 ? std::string() : std::to_string(priority) + " " + std::to_string(number));
  if (number == 0) return;
  const std::lock_guard lock(state.mutex);
  one.new_parts.emplace_back(token, number);
  state.has_news = true;
  state.stir();
}

// Entries: class, token and number of a part that came; or 255, a class, and the number up to which it is acknowledged.
void DirectChannel::State::take_note(std::string_view note) {
  const std::lock_guard lock(mutex);
  for (; note.size() >= kNoteEntry; note.remove_prefix(kNoteEntry)) {
    const std::size_t priority = static_cast<unsigned char>(note.front());
    const auto first = number_at<std::uint64_t>(note, 1);
    const auto second = number_at<std::uint64_t>(note, 9);
    if (priority < in.size()) {
      Publication publication;
      publication.outcome = Publication::Outcome::stored;
      publication.number = second;
      publication.is_repetition = second <= in[priority].confirmed;
      in[priority].confirmed = std::max(in[priority].confirmed, second);
      sender.published(first, publication, now_s());
    } else if (priority == kAcknowledged && first < in.size()) {
      sender.acknowledged(first, second, now_s());
    }
  }
  received_at_s = now_s();
  stir();
}

// Under the lock: what the receiver has done with, up to the first part of each class with which it has not.
void DirectChannel::State::note_acknowledged() {
  const auto done = [&](const std::string& reply) {
    if (reply.empty()) return;
    const std::size_t space = reply.find(' ');
    Incoming& one = in.at(std::stoul(reply.substr(0, space)));
    if (const auto number = std::stoull(reply.substr(space + 1)); number > one.acknowledged) one.beyond.insert(number);
  };
  for (const std::string& reply : receiver.take_acknowledged()) done(reply);
  for (const std::string& reply : receiver.take_refused()) done(reply);
  for (Incoming& one : in) {
    const std::uint64_t before = one.acknowledged;
    while (!one.beyond.empty() && *one.beyond.begin() == one.acknowledged + 1) {
      one.beyond.erase(one.beyond.begin());
      ++one.acknowledged;
    }
    if (one.acknowledged == before) continue;
    has_news = true;
    for (auto part = one.numbers.begin(); part != one.numbers.end();)
      part = part->second <= one.acknowledged ? one.numbers.erase(part) : std::next(part);
  }
}

void DirectChannel::State::say_note() {
  std::string note(1, kNote);
  {
    const std::lock_guard lock(mutex);
    if (is_closed()) return;
    note_acknowledged();
    // The last one may have been lost.
    const bool is_due = now_s() - said_s >= kSayAgain_s && receiver.session() != 0;
    if (!has_news && !is_due) return;
    has_news = false;
    said_s = now_s();
    const auto add = [&](std::size_t priority, std::uint64_t first, std::uint64_t second) {
      note.push_back(static_cast<char>(priority));
      append_number(note, first);
      append_number(note, second);
    };
    for (std::size_t priority = 0; priority < in.size(); ++priority) {
      for (const auto& [token, number] : std::exchange(in[priority].new_parts, {})) add(priority, token, number);
      add(kAcknowledged, priority, in[priority].acknowledged);
    }
  }
  send_packet(std::move(note));
}

// False: nothing is due.
bool DirectChannel::State::send_parts() {
  std::optional<ChannelSender::MessagePart> part;
  {
    const std::lock_guard lock(mutex);
    unconfirmed_parts += sender.expire(now_s());
    part = sender.next(now_s());
  }
  if (!part) return false;
  std::string packet(1, kPart);
  packet.push_back(static_cast<char>(part->priority));
  append_number(packet, part->token);
  send_packet(packet + part->bytes);
  return true;
}

void DirectChannel::State::tick() {
  std::set<std::uint64_t> due;  // to be ended
  bool is_news = false;
  {
    const std::lock_guard lock(mutex);
    if (now_s() - ticked_s < kTick_s) return;
    ticked_s = now_s();
    receiver.tick(now_s());
    for (const std::uint64_t session : receiver.take_unknown_sessions()) {
      if (ended.size() < kMostEnded && ended.insert(session).second)
        log(LogLevel::info, options.peer + ": closed a session that was opened before this program began");
      ends_again = true;
    }
    if (std::exchange(ends_again, false)) due = ended;
    is_news = receiver.has_ready();
    if (is_news) came.notify_all();
  }
  if (is_news) call_listener();
  for (const std::uint64_t session : due) {
    std::string packet(1, kPart);
    packet.push_back(0);
    append_number(packet, std::uint64_t{0});  // nobody waits for its confirmation
    send_packet(packet + end_of(session));
  }
}

void DirectChannel::State::run() {
  std::unique_lock lock(mutex);
  while (!ends || (now_s() < linger_until_s && !is_said())) {
    lock.unlock();
    while (send_parts()) {}
    say_note();
    tick();
    lock.lock();
    changed.wait_for(lock, std::chrono::duration<double>(kTick_s), [&] { return is_stirred || ends; });
    is_stirred = false;
  }
}

DirectChannel::DirectChannel(DirectChannelOptions options, std::function<void(std::string)> send)
    : state_(std::make_unique<State>(std::move(options), std::move(send))) {
  state_->thread = std::thread([state = state_.get()] { state->run(); });
}

DirectChannel::~DirectChannel() {
  set_listener(nullptr);
  close();
  {
    const std::lock_guard lock(state_->mutex);
    state_->ends = true;
    state_->stir();
  }
  state_->thread.join();
}

Channel::Sent DirectChannel::send(Envelope envelope) { return state_->send(std::move(envelope)); }
std::size_t DirectChannel::in_flight_bytes() const { return state_->in_flight_bytes(); }
std::vector<Channel::Delivery> DirectChannel::receive(std::chrono::milliseconds patience) {
  return state_->receive(patience);
}
void DirectChannel::acknowledge(std::uint64_t delivery) { state_->acknowledge(delivery); }
void DirectChannel::set_listener(std::function<void()> listener) { state_->set_listener(std::move(listener)); }
void DirectChannel::close() { state_->close(); }

bool DirectChannel::is_closed() const {
  const std::lock_guard lock(state_->mutex);
  return state_->is_closed();
}

std::optional<Channel::Measured> DirectChannel::bytes_per_s() const {
  const std::lock_guard lock(state_->mutex);
  const auto measured = state_->sender.to_broker();
  if (!measured) return std::nullopt;
  return Measured{measured->bytes_per_s, state_->now_s() - measured->at_s};
}

Channel::Health DirectChannel::health() const {
  const std::lock_guard lock(state_->mutex);
  return state_->health_now();
}

}  // namespace mapweave::transport
