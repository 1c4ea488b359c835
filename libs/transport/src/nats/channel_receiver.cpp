#include <mapweave/core/error.h>
#include <mapweave/transport/channel_receiver.h>

#include <algorithm>
#include <iterator>
#include <utility>

namespace mapweave::transport {
namespace {

constexpr std::size_t kMostEarly = 64, kMostSkipped = 1024;
constexpr std::uint64_t kMostAhead = 1 << 20;  // of the next message: no sender has more on their path
constexpr std::size_t kMostReplies = 64;       // of one message beyond its parts

}  // namespace

ChannelReceiver::ChannelReceiver(ChannelReceiverOptions options)
    : options_(options),
      session_(options.accepts ? 0 : options.session),
      reassembly_(options.limits),
      classes_(options.priorities) {
  MAPWEAVE_EXPECT(options.accepts == (options.session == 0), "who opens a session names it");
}

void ChannelReceiver::acknowledge(std::vector<std::string>&& replies) {
  acknowledged_.insert(acknowledged_.end(), std::make_move_iterator(replies.begin()),
                       std::make_move_iterator(replies.end()));
}

void ChannelReceiver::add(std::size_t priority, std::string_view part, const std::string& reply, double now_s) {
  if (is_closed_) return;  // what comes is the next channel's
  const auto decoded = decode_part(part);
  const auto* known = std::get_if<WirePart>(&decoded);
  if (known != nullptr && is_repetition(priority, *known, reply)) {
    ++counts_.repeated;
    return;
  }
  Reassembly::Result result = reassembly_.add(std::to_string(priority), part, reply, now_s);
  refused_.insert(refused_.end(), result.given_up.begin(), result.given_up.end());
  if (!result.message) return;
  if (result.message->header.priority != priority || priority >= classes_.size())
    return acknowledge(std::move(result.message->tags));
  route(priority, std::move(*result.message), now_s);
}

// Of a message that is complete already.
bool ChannelReceiver::is_repetition(std::size_t priority, const WirePart& part, const std::string& reply) {
  const WireHeader& header = part.header;
  if (header.session != session_ || session_ == 0 || priority >= classes_.size() || header.number == kEndNumber)
    return false;
  Class& one = classes_[priority];
  if (header.number == 1 && one.first && *one.first != header.hash) return false;  // another first one
  // One that is held is not acknowledged before its turn, by whichever of its replies; a few of them are enough.
  std::vector<std::string>* replies = nullptr;
  if (const auto held = one.held.find(header.number); held != one.held.end()) {
    replies = &held->second.replies;
  } else if (const auto waiting = one.waiting.find(header.number); waiting != one.waiting.end()) {
    replies = &waiting->second.tags;
  } else if (header.number >= one.next || one.skipped.count(header.number) > 0) {
    return false;
  }
  if (replies == nullptr)
    acknowledged_.push_back(reply);
  else if (replies->size() < header.parts + kMostReplies)
    replies->push_back(reply);
  return true;
}

void ChannelReceiver::route(std::size_t priority, Reassembly::Message message, double now_s) {
  if (session_ == 0 && message.header.kind == WireKind::opens && priority == 0) {
    session_ = message.header.session;
    order(priority, std::move(message), now_s);
    std::deque<Early> early = std::exchange(early_, {});
    for (Early& one : early) bytes_ -= one.message.envelope.bytes.size();
    for (Early& one : early) route(one.priority, std::move(one.message), one.since_s);
    for (Early& one : early_) one.is_left_over = one.priority == 0;
    return;
  }
  if (message.header.session != session_) return route_of_another(priority, std::move(message), now_s);
  if (message.header.kind == WireKind::closes && message.header.number == kEndNumber) {
    acknowledge(std::move(message.tags));
    return forget_all();
  }
  order(priority, std::move(message), now_s);
}

void ChannelReceiver::route_of_another(std::size_t priority, Reassembly::Message message, double now_s) {
  if (!options_.accepts || message.header.kind == WireKind::closes) {
    ++counts_.stale;
    return acknowledge(std::move(message.tags));
  }
  if (session_ != 0 && message.header.kind == WireKind::opens && priority == 0)
    return forget_all(message.header.session);
  if (early_.size() >= kMostEarly) {
    ++counts_.stale;
    acknowledge(std::move(early_.front().message.tags));
    bytes_ -= early_.front().message.envelope.bytes.size();
    early_.pop_front();
  }
  bytes_ += message.envelope.bytes.size();
  early_.push_back({priority, std::move(message), now_s});
}

// Of older sessions than the one that ends, and of all but the next one where that is known. The next channel would
// read it first, and this session and its end again after it, for ever: a consumer begins where all is acknowledged.
void ChannelReceiver::clear_left_over(std::uint64_t next) {
  for (Early& one : std::exchange(early_, {})) {
    if (!one.is_left_over && (next == 0 || one.message.header.session == next)) {
      early_.push_back(std::move(one));
      continue;
    }
    ++counts_.stale;
    bytes_ -= one.message.envelope.bytes.size();
    acknowledge(std::move(one.message.tags));
  }
}

// The session has ended; what is not acknowledged of the next one stays for the next channel.
void ChannelReceiver::forget_all(std::uint64_t next) {
  is_closed_ = true;
  clear_left_over(next);
  for (Class& one : classes_) {
    for (auto& [number, held] : one.held) acknowledge(std::move(held.replies));
    for (auto& [number, waiting] : one.waiting) acknowledge(std::move(waiting.tags));
    one.held.clear();
    one.waiting.clear();
  }
  delivered_.clear();
}

void ChannelReceiver::order(std::size_t priority, Reassembly::Message message, double now_s) {
  Class& one = classes_[priority];
  const std::uint64_t number = message.header.number;
  if (number == 1) {
    if (one.first && *one.first != message.header.hash) {  // its program was started again
      acknowledge(std::move(message.tags));
      return forget_all();
    }
    one.first = message.header.hash;
  }
  if (number < one.next && one.skipped.erase(number) > 0) return deliver(one, number, std::move(message));
  if (number < one.next || number - one.next > kMostAhead) {
    ++counts_.stale;
    return acknowledge(std::move(message.tags));
  }
  bytes_ += message.envelope.bytes.size();
  one.waiting.emplace(number, std::move(message));
  deliver_next(one, now_s);
}

void ChannelReceiver::deliver_next(Class& one, double now_s) {
  while (!one.waiting.empty() && one.waiting.begin()->first == one.next && !is_closed_) {
    Reassembly::Message message = std::move(one.waiting.begin()->second);
    one.waiting.erase(one.waiting.begin());
    bytes_ -= message.envelope.bytes.size();
    deliver(one, one.next++, std::move(message));
    one.missing_since_s.reset();
  }
  if (one.waiting.empty())
    one.missing_since_s.reset();
  else if (!one.missing_since_s)
    one.missing_since_s = now_s;
}

void ChannelReceiver::deliver(Class& one, std::uint64_t number, Reassembly::Message message) {
  Held held;
  held.replies = std::move(message.tags);
  if (message.header.kind != WireKind::message) {
    held.is_acknowledged = true;
    one.held.emplace(number, std::move(held));
    release(one);
    if (message.header.kind == WireKind::closes) {
      is_closed_ = true;
      clear_left_over(0);
    }
    return;
  }
  held.delivery = ++deliveries_;
  held.bytes = message.envelope.bytes.size();
  bytes_ += held.bytes;
  ++counts_.messages;
  counts_.bytes += held.bytes;
  delivered_.emplace(held.delivery, std::make_pair(static_cast<std::size_t>(&one - classes_.data()), number));
  ready_.push_back({std::move(message.envelope), held.delivery});
  one.held.emplace(number, std::move(held));
}

std::vector<Channel::Delivery> ChannelReceiver::take() { return std::exchange(ready_, {}); }

void ChannelReceiver::acknowledge(std::uint64_t delivery) {
  const auto known = delivered_.find(delivery);
  if (known == delivered_.end()) return;
  Class& one = classes_[known->second.first];
  one.held.at(known->second.second).is_acknowledged = true;
  delivered_.erase(known);
  release(one);
}

void ChannelReceiver::release(Class& one) {
  while (!one.held.empty() && one.held.begin()->second.is_acknowledged) {
    Held& first = one.held.begin()->second;
    bytes_ -= first.bytes;
    acknowledge(std::move(first.replies));
    one.held.erase(one.held.begin());
  }
}

void ChannelReceiver::tick(double now_s) {
  for (std::string& reply : reassembly_.expire(now_s)) refused_.push_back(std::move(reply));
  while (!early_.empty() && now_s - early_.front().since_s > options_.early_s) {
    Early& first = early_.front();
    const std::uint64_t session = first.message.header.session;
    if (std::find(unknown_.begin(), unknown_.end(), session) == unknown_.end()) unknown_.push_back(session);
    ++counts_.stale;
    bytes_ -= first.message.envelope.bytes.size();
    acknowledge(std::move(first.message.tags));
    early_.pop_front();
  }
  for (Class& one : classes_) {
    if (!one.missing_since_s || now_s - *one.missing_since_s < options_.missing_s) continue;
    for (const std::uint64_t there = one.waiting.begin()->first; one.next < there; ++one.next) {
      ++counts_.skipped;
      one.skipped.insert(one.next);
      if (one.skipped.size() > kMostSkipped) one.skipped.erase(one.skipped.begin());
    }
    one.missing_since_s.reset();
    deliver_next(one, now_s);
  }
}

std::vector<std::string> ChannelReceiver::held() const {
  std::vector<std::string> all = reassembly_.tags();
  const auto add = [&](const std::vector<std::string>& replies) {
    all.insert(all.end(), replies.begin(), replies.end());
  };
  for (const Class& one : classes_) {
    for (const auto& [number, held] : one.held) add(held.replies);
    for (const auto& [number, waiting] : one.waiting) add(waiting.tags);
  }
  for (const Early& one : early_) add(one.message.tags);
  return all;
}

}  // namespace mapweave::transport
