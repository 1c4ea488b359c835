#include "numbered_wire.h"

#include <mapweave/core/error.h>
#include <mapweave/core/log.h>
#include <mapweave/maps/receipt.h>

#include <algorithm>
#include <utility>

namespace mapweave::runtime {
namespace {

// Both ends speak alike, so that a word means the same in either direction.
constexpr char kHello[] = "hello", kWelcome[] = "welcome", kReceipts[] = "receipts", kRefusal[] = "refusal";
constexpr std::size_t kMostWaiting = 1024, kMostWaitingBytes = std::size_t{64} << 20;  // for a missing number

Origin origin_of(const SessionId& session) {
  return {TierId(session.client.robot.str()), MapId("run" + std::to_string(session.run))};
}
std::string numbers_of(const SessionId& session) {
  return session.client.robot.str() + "/" + std::to_string(session.run);
}

double seconds_between(Clock::time_point from, Clock::time_point to) {
  return std::chrono::duration<double>(to - from).count();
}

}  // namespace

NumberedWire::NumberedWire(SessionId self, Hash agreement, std::string peer, const LiveWireOptions& options,
                           WireHooks hooks)
    : self_(std::move(self)),
      agreement_(agreement),
      peer_(std::move(peer)),
      options_(options),
      hooks_(std::move(hooks)),
      outbox_(options.window_bytes()) {}

transport::Channel::Health NumberedWire::health() const {
  transport::Channel::Health health = channel_ != nullptr ? channel_->health() : transport::Channel::Health{};
  add_counts(before_, health);
  return health;
}

void NumberedWire::use(std::shared_ptr<transport::Channel> channel) {
  before_ = health();
  channel_ = std::move(channel);
  is_welcome_ = is_too_long_ = false;
  greeted_ = {};
  opened_at_ = Clock::now();
  outbox_.repeat_all();
}

void NumberedWire::append(std::string subject, std::string bytes) {
  ++appended_;
  if (appended_ <= confirmed_) return;
  backlog_bytes_ += bytes.size();
  backlog_.push_back({std::move(subject), std::move(bytes), numbers_of(self_), appended_});
}

void NumberedWire::begin_anew(SessionId self) {
  self_ = std::move(self);
  outbox_ = transport::MemoryOutbox(options_.window_bytes());
  backlog_.clear();
  backlog_bytes_ = 0;
  appended_ = confirmed_ = 0;
  is_welcome_ = false;
  greeted_ = {};
}

void NumberedWire::store(std::uint64_t up_to) {
  if (up_to <= stored_) return;
  stored_ = up_to;
  taken_ = std::max(taken_, stored_);  // it came on a wire before
  is_receipt_due_ = true;
}

bool NumberedWire::send(transport::Envelope message) {
  const std::size_t bytes = message.bytes.size();
  switch (channel_->send(std::move(message))) {
    case transport::Channel::Sent::taken:
      ++counts_.sent;
      counts_.sent_bytes += bytes;
      return true;
    case transport::Channel::Sent::later: return false;
    case transport::Channel::Sent::never: break;
  }
  if (!channel_->is_closed() && !std::exchange(is_too_long_, true))
    log(LogLevel::error, "a message of " + std::to_string(bytes) + " bytes is too long for the wire to " + peer_ +
                             "; nothing after it gets there");
  return false;
}

void NumberedWire::step(Clock::time_point now, bool holds) {
  if (channel_ == nullptr) return;
  if (!holds)
    for (transport::Channel::Delivery& one : channel_->receive(std::chrono::milliseconds(0))) {
      receive(std::move(one.envelope), now);
      channel_->acknowledge(one.number);
    }
  if (channel_->is_closed()) return;
  if (const auto measured = channel_->bytes_per_s()) bytes_per_s_ = measured->bytes_per_s;
  try {
    take_waiting();
  } catch (const Error& error) {
    count_unreadable(error, true);
  }
  if (!is_welcome_ && seconds_between(greeted_, now) >= options_.repeat_s &&
      send({kHello, encode(Hello{self_, agreement_}), {}, 0, true}))
    greeted_ = now;
  if (is_welcome_) send_due(now);
  if (!other_ || (!is_receipt_due_ && seconds_between(receipt_at_, now) < options_.repeat_s)) return;
  const std::uint64_t awaited = waiting_.empty() ? 0 : taken_ + 1;
  if (send({kReceipts, encode(std::vector<Receipt>{{origin_of(*other_), stored_, awaited}}), {}, 0, true})) {
    is_receipt_due_ = false;
    receipt_at_ = now;
  }
}

void NumberedWire::receive(transport::Envelope message, Clock::time_point now) {
  const bool is_numbered = message.sequence > 0;
  try {
    received_at_ = now;
    if (message.subject == kHello) {
      greet(decode_hello(message.bytes, peer_));
    } else if (message.subject == kWelcome || message.subject == kReceipts) {
      take_receipts(decode_receipts(message.bytes, peer_), message.subject == kWelcome, now);
    } else if (message.subject == kRefusal) {
      const std::string why = decode_refusal(message.bytes, peer_).why.what();
      if (refusal_ != why) log(LogLevel::warning, peer_ + " refuses: " + why);
      refusal_ = why;
    } else {
      take(std::move(message));
    }
  } catch (const Error& error) {
    count_unreadable(error, is_numbered);
  }
}

void NumberedWire::count_unreadable(const Error& error, bool is_numbered) {
  if (counts_.unreadable++ == 0)  // a flood of them is counted
    log(LogLevel::warning, "what " + peer_ + " sent cannot be read: " + error.what());
  if (is_numbered) send({kRefusal, encode(Refusal{error}), {}, 0, true});
}

void NumberedWire::greet(const Hello& hello) {
  try {
    if (hello.vocabulary != agreement_)
      throw Error(ErrorCode::kBadInput, "it has another configuration, or is another version of mapweave", peer_,
                  "give all programs of a deployment the same configuration and version");
    const std::uint64_t stored = hooks_.greet(hello);
    if (other_ != hello.session) {
      if (other_) is_welcome_ = false;  // it began anew, and may know nothing
      other_ = hello.session;
      taken_ = stored_ = stored;
      waiting_.clear();
      waiting_received_bytes_ = 0;
    }
    send({kWelcome, encode(std::vector<Receipt>{{origin_of(hello.session), stored_, 0}}), {}, 0, true});
  } catch (const Error& error) {
    ++counts_.refused;
    if (refusal_ != error.what()) log(LogLevel::warning, "refused on a wire: " + std::string(error.what()));
    refusal_ = error.what();
    send({kRefusal, encode(Refusal{error}), {}, 0, true});
  }
}

void NumberedWire::take_receipts(const std::vector<Receipt>& receipts, bool is_welcome, Clock::time_point now) {
  const Origin own = origin_of(self_);
  for (const Receipt& receipt : receipts) {
    if (receipt.origin.tier != own.tier || receipt.origin.map != own.map) continue;  // of a run before
    if (is_welcome && !is_welcome_ && receipt.stored < confirmed_) {
      log(LogLevel::warning, peer_ + " lacks what it had confirmed; all is sent again");
      return hooks_.lost();
    }
    if (is_welcome && !std::exchange(is_welcome_, true)) {
      refusal_.clear();
      progress_ = now;
      outbox_.repeat_all();
    }
    if (receipt.stored > confirmed_) {
      confirmed_ = receipt.stored;
      progress_ = now;
      outbox_.forget(numbers_of(self_), confirmed_);
      while (!backlog_.empty() && backlog_.front().sequence <= confirmed_) {
        backlog_bytes_ -= backlog_.front().bytes.size();
        backlog_.pop_front();
      }
    }
    if (receipt.awaited > 0 && seconds_between(asked_again_, now) >= 0.1 * options_.repeat_s) {
      asked_again_ = now;
      outbox_.repeat(numbers_of(self_), receipt.awaited);
    }
  }
}

void NumberedWire::take(transport::Envelope message) {
  if (!other_ || message.sequence == 0 || message.sender != numbers_of(*other_)) return;  // it says hello again
  if (message.sequence <= taken_) {
    ++counts_.again;
    is_receipt_due_ = true;
    return;
  }
  Said said{std::move(message.subject), std::move(message.bytes), message.sequence};
  if (said.number != taken_ + 1) {
    is_receipt_due_ = true;
    const std::size_t bytes = said.bytes.size();
    if (waiting_.size() < kMostWaiting && waiting_received_bytes_ + bytes <= kMostWaitingBytes &&
        waiting_.emplace(said.number, std::move(said)).second)
      waiting_received_bytes_ += bytes;
    return;
  }
  take_next(std::move(said));
  take_waiting();
}

void NumberedWire::take_next(Said said) {
  const std::uint64_t number = said.number;
  hooks_.take(std::move(said));
  taken_ = std::max(taken_, number);
  ++counts_.taken;
}

void NumberedWire::take_waiting() {
  while (!waiting_.empty() && waiting_.begin()->first <= taken_ + 1) {
    Said said = std::move(waiting_.begin()->second);
    waiting_.erase(waiting_.begin());
    waiting_received_bytes_ -= said.bytes.size();
    if (said.number > taken_) take_next(std::move(said));
  }
}

void NumberedWire::send_due(Clock::time_point now) {
  while (!backlog_.empty() && outbox_.has_room()) {
    backlog_bytes_ -= backlog_.front().bytes.size();
    outbox_.append(std::move(backlog_.front()));
    backlog_.pop_front();
  }
  if (!is_all_confirmed() && seconds_between(progress_, now) >= options_.repeat_s) {
    outbox_.repeat_all();
    progress_ = now;
  }
  bool is_taken = true;
  for (transport::Envelope& message : outbox_.take_due()) {
    const std::uint64_t number = message.sequence;
    is_taken = is_taken && send(std::move(message));
    if (!is_taken) outbox_.repeat(numbers_of(self_), number);
  }
}

}  // namespace mapweave::runtime
