#include "nats_channel_state.h"

#include <mapweave/core/error.h>
#include <mapweave/core/log.h>

#include <algorithm>

namespace mapweave::transport {
namespace {

using std::chrono::milliseconds;

constexpr auto kPatience = milliseconds(5000);  // of one question to the broker
constexpr int kBatch = 64;                      // messages asked for at once
constexpr double kPull_s = 4.0,
                 kFarPull_s = 2.0;  // so long it waits at the broker: one that got lost holds up no longer
constexpr double kLeastAsk_s = 0.05, kMostAsk_s = 1.0;
constexpr double kPurge_s = 1.0, kFull_s = 5.0, kTick_s = 0.2, kLeastEnsure_s = 0.2, kMostEnsure_s = 5.0;
// What was deleted is made again so much later: where it was made while a broker (2.9) was still at deleting, its
// consumers never delivered anything. Of a busy broker that happens later as well: what has messages, and delivers none
// of them to so many requests in a row, is deleted, which does help.
constexpr double kDeletion_s = 1.0;
constexpr int kMostSilent = 2;
constexpr std::int64_t kMostUnacknowledged = 8192;  // parts: more than the longest message has

std::string stream_name(const NatsRoute& route, std::size_t priority) {
  return route.streams + "_" + std::to_string(priority);
}
std::string subject_of(const NatsRoute& route, std::size_t priority, const std::string& token) {
  return "mw." + route.streams + "." + std::to_string(priority) + "." + token;
}

StreamOptions stream_options(const NatsRoute& route, std::size_t priority) {
  return {stream_name(route, priority), {subject_of(route, priority, "*")}, route.domain, route.stream_bytes, 120.0};
}
ConsumerOptions consumer_options(const NatsRoute& route, std::size_t priority, const std::string& peer,
                                 double repeat_s) {
  const std::string token = nats_token(peer);
  return {stream_name(route, priority),       route.domain, token,
          subject_of(route, priority, token), repeat_s,     kMostUnacknowledged};
}

// Half of the stream at most is not acknowledged: what is can always be taken away, so that the rest finds room.
ChannelEndOptions end_options_of(const NatsChannelOptions& options) {
  ChannelLimits limits = options.limits;
  limits.bytes = std::min<std::uint64_t>(limits.bytes, options.out.stream_bytes / 2);
  return {options.side == NatsChannelSide::opens,
          options.priorities,
          {options.priorities.size() + 1, limits, options.received.message_bytes},
          options.received,
          options.missing_s,
          options.linger_s};
}

}  // namespace

NatsChannel::State::State(std::shared_ptr<NatsConnection> made, NatsChannelOptions given, std::uint64_t number)
    : ChannelEnd(end_options_of(given), number), connection(std::move(made)), options(std::move(given)) {
  MAPWEAVE_EXPECT(!options.peer.empty() && !options.out.streams.empty() && !options.in.streams.empty(),
                  "a channel has a name and two directions");
}

void NatsChannel::State::open() {
  const std::weak_ptr<State> weak = weak_from_this();
  answers = connection->open_inbox(
      [weak](const NatsMessage& message) {
        if (const auto state = weak.lock()) state->on_answer(message);
      },
      InboxKind::answers);
  for (std::size_t priority = 0; priority <= options.priorities.size(); ++priority) {
    out.push_back({NatsStream(connection, stream_options(options.out, priority)),
                   NatsConsumer(connection, consumer_options(options.out, priority, options.peer, options.repeat_s))});
    in.push_back({NatsConsumer(connection, consumer_options(options.in, priority, options.peer, options.repeat_s)),
                  NatsStream(connection, stream_options(options.in, priority)),
                  connection->open_inbox(
                      [weak, priority](const NatsMessage& message) {
                        if (const auto state = weak.lock()) state->on_delivery(priority, message);
                      },
                      InboxKind::deliveries)});
  }
}

// Subjects of answers: "<inbox>.p.<token>" to a part, "<inbox>.o.<class>" and "<inbox>.i.<class>" to questions.
void NatsChannel::State::on_answer(const NatsMessage& message) {
  if (message.subject.empty()) {
    const std::lock_guard lock(mutex);
    return stir();
  }
  const std::string& root = answers->subject();
  if (message.subject.size() < root.size() + 4) return;
  const char kind = message.subject[root.size() + 1];
  const std::uint64_t number = std::strtoull(message.subject.c_str() + root.size() + 3, nullptr, 10);
  if (kind == 'p') {
    const Publication publication = publication_of(message);
    const std::lock_guard lock(mutex);
    sender.published(number, publication, now_s());
    if (publication.outcome == Publication::Outcome::no_stream) found_gone();
    stir();
  } else if (number < out.size()) {
    kind == 'o' ? on_state_out(number, consumer_state_of(message)) : on_state_in(number, consumer_state_of(message));
  }
}

void NatsChannel::State::on_state_out(std::size_t priority, const std::optional<ConsumerState>& state) {
  const std::lock_guard lock(mutex);
  Outgoing& one = out[priority];
  if (!state) {  // the other end was never there, or the stream is gone with all that was in it
    one.is_sure = false;
    return;
  }
  shown.has_reader = state->readers > 0;
  // Who reads has made its consumer again, and another program the stream, perhaps.
  if (const std::string before = std::exchange(one.reader_created, state->created);
      !before.empty() && before != state->created)
    one.is_sure = false;
  if (state->acknowledged != one.acknowledged) one.ask_every_s = kLeastAsk_s;
  one.acknowledged = state->acknowledged;
  sender.acknowledged(priority, state->acknowledged, now_s());
  stir();
  // What the other end has acknowledged it takes away itself; where there is no room for long, nobody waits for that.
  const auto full_since_s = sender.full_since_s();
  if (full_since_s && now_s() - *full_since_s > kFull_s)
    one.stream.purge(one.readers.options().subject, state->acknowledged + 1);
}

void NatsChannel::State::on_state_in(std::size_t priority, const std::optional<ConsumerState>& state) {
  if (!state) return;
  Incoming& one = in[priority];
  {
    const std::lock_guard lock(mutex);
    const bool is_silent =
        state->waiting > 0 && state->delivered == state->acknowledged && now_s() - one.delivered_s > kPull_s;
    one.times_silent = is_silent ? one.times_silent + 1 : 0;
    if (one.times_silent == kMostSilent) {
      log(LogLevel::warning, "stream '" + one.stream.options().name +
                                 "' delivers nothing of what it has: deleted, so that its sender makes it again");
      one.times_silent = 0;
      one.is_sure = false;
      found_gone();
      return one.stream.remove();
    }
    // The broker may not have seen the last ones yet.
    if (state->acknowledged < state->delivered) one.has_new_acknowledged = true;
    if (std::exchange(one.purged, state->acknowledged) == state->acknowledged) return;
  }
  one.stream.purge(one.consumer.options().subject, state->acknowledged + 1);
}

void NatsChannel::State::on_delivery(std::size_t priority, const NatsMessage& message) {
  if (message.subject.empty()) return;
  {
    const std::lock_guard lock(mutex);
    Incoming& one = in[priority];
    stir();
    if (message.status != 0) {  // less than was asked for: the question is answered
      one.asked_for = 0;
      if (message.status == 409 || message.status == 503) {  // the consumer may be gone
        one.is_sure = false;
        found_gone();
      } else if (now_s() - one.delivered_s > kPull_s) {
        one.asks_why_silent = true;
      }
      return;
    }
    if (one.asked_for > 0) --one.asked_for;
    one.bytes_since_purge += message.bytes.size();
    one.delivered_s = now_s();
    one.times_silent = 0;
  }
  take(priority, message.bytes, message.reply);
}

// Said again and again until it is made.
void NatsChannel::State::found_gone() {
  if (now_s() - gone_s > kMostEnsure_s) gone_s = now_s();
}

void NatsChannel::State::run() {
  std::unique_lock lock(mutex);
  while (!ends || now_s() < linger_until_s) {
    const std::uint64_t now_generation = connection->generation();
    if (now_generation != generation) {
      generation = now_generation;
      sender.lost();
      for (Outgoing& one : out) one.is_sure = false;
      // What was delivered and got lost comes again at once.
      for (Incoming& one : in) {
        one.is_sure = false;
        one.is_to_restart = true;
      }
      ensure_every_s = 0.0;
    }
    lock.unlock();
    if (connection->state().is_connected) {
      ensure();
      publish();
      answer_broker();
      pull();
      ask_states();
      keep_held();
    }
    tick_receiver();
    lock.lock();
    if (is_done()) return;
    changed.wait_for(lock, std::chrono::duration<double>(wait_s()), [&] { return is_stirred || ends; });
    is_stirred = false;
  }
}

// Under the lock.
double NatsChannel::State::wait_s() const {
  double soonest_s = kTick_s;
  for (std::size_t priority = 0; priority < out.size(); ++priority)
    if (sender.awaits(priority)) soonest_s = std::min(soonest_s, std::max(kLeastAsk_s, out[priority].ask_every_s));
  return soonest_s;
}

// Under the lock: closed, and what was sent is with the broker, or cannot get there.
bool NatsChannel::State::is_done() {
  if (!ends) return false;
  return is_said() || !connection->state().is_connected;
}

// Whether it worked; why not is what holds the channel up. Said when it stays so: ends may start in any order.
bool NatsChannel::State::try_to(const std::function<void()>& work) {
  try {
    work();
    return true;
  } catch (const Error& error) {
    times_troubled = error.what() == last_trouble ? times_troubled + 1 : 1;
    last_trouble = error.what();
    if (times_troubled == 3) log(LogLevel::warning, options.peer + ": " + last_trouble);
  }
  const std::lock_guard lock(mutex);
  shown.trouble = last_trouble;
  return false;
}

void NatsChannel::State::ensure() {
  std::vector<std::size_t> streams, consumers;
  {
    const std::lock_guard lock(mutex);
    if (now_s() - ensured_s < ensure_every_s || now_s() - gone_s < kDeletion_s) return;
    for (std::size_t priority = 0; priority < out.size(); ++priority) {
      if (sender.has_no_stream(priority)) out[priority].is_sure = false;
      if (!out[priority].is_sure) streams.push_back(priority);
      if (!in[priority].is_sure && !is_closed()) consumers.push_back(priority);
    }
    if (streams.empty() && consumers.empty()) {
      gone_s = kLongAgo_s;  // what is deleted from now on is deleted anew
      return;
    }
  }
  ensure_streams(streams);
  ensure_consumers(consumers);
  const std::lock_guard lock(mutex);
  ensured_s = now_s();
  const bool all = std::all_of(out.begin(), out.end(), [](const Outgoing& one) { return one.is_sure; }) &&
                   std::all_of(in.begin(), in.end(), [](const Incoming& one) { return one.is_sure; });
  if (all) {
    gone_s = kLongAgo_s;
    shown.trouble.clear();
    last_trouble.clear();
  }
  ensure_every_s = all ? kLeastEnsure_s : std::clamp(2.0 * ensure_every_s, kLeastEnsure_s, kMostEnsure_s);
}

void NatsChannel::State::ensure_streams(const std::vector<std::size_t>& priorities) {
  for (const std::size_t priority : priorities) {
    Outgoing& one = out[priority];
    bool is_made = false;
    const bool works = try_to([&] { is_made = one.stream.ensure(kPatience); });
    const std::lock_guard lock(mutex);
    one.is_sure = works;
    if (!is_made) continue;
    ++shown.streams_made;
    sender.stream_lost(priority);
    log(LogLevel::info, "stream '" + one.stream.options().name + "' is new");
  }
}

void NatsChannel::State::ensure_consumers(const std::vector<std::size_t>& priorities) {
  for (const std::size_t priority : priorities) {
    Incoming& one = in[priority];
    bool is_made = false, is_new_stream = false;
    const bool works = try_to([&] {
      is_new_stream = options.makes_streams && one.stream.ensure(kPatience);
      is_made = one.consumer.ensure(kPatience);
      if (!is_made && one.is_to_restart) one.consumer.restart(kPatience);
    });
    const std::lock_guard lock(mutex);
    one.is_sure = works;
    if (!works) continue;
    // What was in the stream before is gone, and its sender may not learn of it: both ends begin anew.
    if (is_new_stream && one.was_sure) receiver.close();
    one.was_sure = true;
    one.asked_for = 0;
    one.is_to_restart = false;
    if (!is_made) continue;
    if (++shown.consumers_made > in.size())
      log(LogLevel::warning, "made consumer '" + one.consumer.options().name + "' of stream '" +
                                 one.consumer.options().stream + "' again, which was gone");
  }
}

void NatsChannel::State::publish() {
  for (;;) {
    std::optional<ChannelSender::MessagePart> part;
    {
      const std::lock_guard lock(mutex);
      unconfirmed_parts += sender.expire(now_s());
      part = sender.next(now_s());
      if (part) {
        ++shown.sent_parts;
        shown.sent_bytes += part->bytes.size();
        out[part->priority].ask_every_s = kLeastAsk_s;
      }
    }
    if (!part) return;
    const std::string& subject = out[part->priority].readers.options().subject;
    if (connection->publish(subject, part->bytes, answers->subject() + ".p." + std::to_string(part->token),
                            part->message_id))
      continue;
    const std::lock_guard lock(mutex);
    return sender.not_sent(part->token);
  }
}

void NatsChannel::State::answer_broker() {
  std::vector<std::string> acknowledged, refused;
  {
    const std::lock_guard lock(mutex);
    acknowledged = receiver.take_acknowledged();
    refused = receiver.take_refused();
    if (!acknowledged.empty())
      for (Incoming& one : in) one.has_new_acknowledged = true;
  }
  // One that is lost with the connection is asked for again, by another delivery.
  for (const std::string& reply : acknowledged) in.front().consumer.acknowledge(reply);
  for (const std::string& reply : refused) in.front().consumer.refuse(reply);
}

void NatsChannel::State::pull() {
  // Of another domain no sign comes when the wire between the brokers is cut: asked anew more often.
  const double within_s = options.in.domain.empty() ? kPull_s : kFarPull_s;
  for (Incoming& one : in) {
    {
      const std::lock_guard lock(mutex);
      // A session that was closed leaves the rest to the next channel.
      if (!one.is_sure || is_closed() || receiver.bytes() > options.most_received_bytes) continue;
      const bool is_overdue = one.asked_for > 0 && now_s() > one.asked_until_s;
      if (is_overdue) one.is_sure = false;  // see whether it is still there
      if (one.asked_for > kBatch / 4 && !is_overdue) continue;
      one.asked_for = (is_overdue ? 0 : one.asked_for) + kBatch;
      one.asked_until_s = now_s() + within_s + 1.0;
    }
    one.consumer.pull(one.inbox->subject(), kBatch, within_s);
  }
}

void NatsChannel::State::ask_states() {
  for (std::size_t priority = 0; priority < out.size(); ++priority) {
    bool asks_out = false, asks_in = false;
    {
      const std::lock_guard lock(mutex);
      Outgoing& sent = out[priority];
      Incoming& got = in[priority];
      asks_out = sender.awaits(priority) && sender.session() != 0 && now_s() - sent.asked_s > sent.ask_every_s;
      if (asks_out) {
        sent.asked_s = now_s();
        sent.ask_every_s = std::clamp(1.5 * sent.ask_every_s, kLeastAsk_s, kMostAsk_s);
      }
      // A stream of which an eighth can be taken away is not left to fill up.
      const bool is_much = got.bytes_since_purge > options.in.stream_bytes / 8;
      asks_in = got.has_new_acknowledged && now_s() - got.purged_s > (is_much ? kLeastAsk_s : kPurge_s);
      if (asks_in || std::exchange(got.asks_why_silent, false)) {
        asks_in = true;
        got.bytes_since_purge = 0;
        got.purged_s = now_s();
        got.has_new_acknowledged = false;
      }
    }
    const std::string number = std::to_string(priority);
    if (asks_out) out[priority].readers.ask_state(answers->subject() + ".o." + number);
    if (asks_in) in[priority].consumer.ask_state(answers->subject() + ".i." + number);
  }
}

void NatsChannel::State::keep_held() {
  std::vector<std::string> held;
  {
    const std::lock_guard lock(mutex);
    if (now_s() - kept_s < options.repeat_s / 3.0) return;
    kept_s = now_s();
    held = receiver.held();
  }
  for (const std::string& reply : held) in.front().consumer.keep(reply);
}

void NatsChannel::State::tick_receiver() {
  std::vector<std::uint64_t> unknown;
  {
    const std::lock_guard lock(mutex);
    if (now_s() - ticked_s < kTick_s) return;
    ticked_s = now_s();
    receiver.tick(now_s());
    unknown = receiver.take_unknown_sessions();
    if (receiver.has_ready()) {
      came.notify_all();
      connection->post([weak = weak_from_this()] {
        if (const auto state = weak.lock()) state->call_listener();
      });
    }
  }
  for (const std::uint64_t session : unknown) {
    connection->publish(out.front().readers.options().subject, end_of(session));
    log(LogLevel::info, options.peer + ": closed a session that was opened before this program began");
  }
}

}  // namespace mapweave::transport
