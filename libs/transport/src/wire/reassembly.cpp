#include <mapweave/core/error.h>
#include <mapweave/transport/reassembly.h>

#include <algorithm>
#include <iterator>
#include <utility>

namespace mapweave::transport {
namespace {

// What keeping a part takes beside its bytes: so that many tiny parts are not free.
constexpr std::size_t kKeepingBytes = 512;

void append(std::vector<std::string>& to, std::vector<std::string>&& from) {
  to.insert(to.end(), std::make_move_iterator(from.begin()), std::make_move_iterator(from.end()));
}

bool is_same(const WireHeader& a, const WireHeader& b) {
  return a.kind == b.kind && a.parts == b.parts && a.bytes == b.bytes;
}

}  // namespace

Reassembly::Reassembly(ReassemblyLimits limits) : limits_(limits) {
  MAPWEAVE_EXPECT(limits.waiting_bytes / 2 >= limits.message_bytes && limits.waiting_messages > 0,
                  "the longest message has room");
}

Reassembly::Result Reassembly::add(const std::string& sender, std::string_view part, std::string tag, double now_s) {
  Result result;
  const auto refuse = [&](WireRefusal reason) {
    count(reason);
    result.refusal = reason;
    result.given_up.push_back(std::move(tag));
  };
  Sender* const known = sender_named(sender, now_s);
  if (known == nullptr) {
    refuse(WireRefusal::too_many_senders);
    return result;
  }
  if (!is_allowed(*known, part.size(), now_s)) {
    refuse(WireRefusal::too_fast);
    return result;
  }
  const auto decoded = decode_part(part);
  if (const auto* refusal = std::get_if<WireRefusal>(&decoded)) {
    refuse(*refusal);
    return result;
  }
  if (const auto refusal = keep(*known, std::get<WirePart>(decoded), tag, result)) refuse(*refusal);
  return result;
}

Reassembly::Sender* Reassembly::sender_named(const std::string& name, double now_s) {
  const auto known = senders_.find(name);
  if (known != senders_.end()) return &known->second;
  if (senders_.size() >= limits_.senders) {
    // One that is silent for long has nothing that waits, and its allowance is full again.
    const auto silent = std::find_if(senders_.begin(), senders_.end(), [&](const auto& one) {
      return one.second.waiting.empty() && now_s - one.second.last_s > limits_.burst_s;
    });
    if (silent == senders_.end()) return nullptr;
    senders_.erase(silent);
  }
  Sender sender;
  sender.allowed_bytes = limits_.bytes_per_s * limits_.burst_s;
  sender.allowed_parts = limits_.parts_per_s * limits_.burst_s;
  sender.last_s = now_s;
  return &senders_.emplace(name, std::move(sender)).first->second;
}

bool Reassembly::is_allowed(Sender& sender, std::size_t bytes, double now_s) const {
  const double passed_s = std::max(0.0, now_s - std::exchange(sender.last_s, now_s));
  const auto grow = [&](double& allowed, double per_s) {
    allowed = std::min(per_s * limits_.burst_s, allowed + per_s * passed_s);
  };
  grow(sender.allowed_bytes, limits_.bytes_per_s);
  grow(sender.allowed_parts, limits_.parts_per_s);
  const auto size = static_cast<double>(bytes);
  if (limits_.bytes_per_s > 0.0 && sender.allowed_bytes < size) return false;
  if (limits_.parts_per_s > 0.0 && sender.allowed_parts < 1.0) return false;
  sender.allowed_bytes -= size;
  sender.allowed_parts -= 1.0;
  return true;
}

std::optional<WireRefusal> Reassembly::keep(Sender& sender, const WirePart& part, std::string& tag, Result& result) {
  if (part.header.bytes > limits_.message_bytes) return WireRefusal::too_long;
  const Key key{part.header.session, part.header.priority, part.header.number, part.header.hash};
  auto one = sender.waiting.find(key);
  const bool is_new = one == sender.waiting.end();
  if (!is_new) {
    const Envelope& known = one->second.envelope;
    if (!is_same(one->second.header, part.header) || known.subject != part.subject || known.sender != part.sender ||
        known.sequence != part.sequence || known.last_counts != part.last_counts)
      return WireRefusal::contradiction;
    if (const auto there = one->second.parts.find(part.part); there != one->second.parts.end()) {
      if (there->second.bytes != part.bytes) return WireRefusal::contradiction;
      there->second.tag = std::move(tag);
      return std::nullopt;
    }
    if (one->second.bytes + part.bytes.size() > part.header.bytes) return WireRefusal::contradiction;
  }
  const std::size_t cost = part.bytes.size() + kKeepingBytes;
  if (!make_room(sender, key, cost, result.given_up)) return WireRefusal::too_long;
  if (is_new) {
    one = sender.waiting.emplace(key, IncompleteMessage()).first;
    one->second.header = part.header;
    one->second.envelope = {part.subject, {}, part.sender, part.sequence, part.last_counts};
  }
  IncompleteMessage& waiting = one->second;
  waiting.parts.insert_or_assign(part.part, ReceivedPart{std::string(part.bytes), std::move(tag)});
  waiting.bytes += part.bytes.size();
  waiting.cost += cost;
  waiting.last_s = sender.last_s;
  sender.cost += cost;
  waiting_bytes_ += cost;
  if (waiting.parts.size() < waiting.header.parts) return std::nullopt;

  Message message{waiting.header, waiting.envelope, {}};
  message.envelope.bytes.reserve(waiting.bytes);
  for (const auto& [index, one_part] : waiting.parts) message.envelope.bytes += one_part.bytes;
  std::vector<std::string> tags;
  drop(sender, one, tags);
  if (message.envelope.bytes.size() != message.header.bytes ||
      wire_hash(message.header, message.envelope) != message.header.hash) {
    tag = std::move(tags.back());
    tags.pop_back();
    append(result.given_up, std::move(tags));
    return WireRefusal::wrong_hash;
  }
  message.tags = std::move(tags);
  result.message = std::move(message);
  return std::nullopt;
}

bool Reassembly::make_room(Sender& sender, const Key& keep, std::size_t cost, std::vector<std::string>& given_up) {
  const bool is_new = sender.waiting.count(keep) == 0;
  while (sender.cost + cost > limits_.waiting_bytes ||
         sender.waiting.size() + (is_new ? 1 : 0) > limits_.waiting_messages) {
    auto oldest = sender.waiting.end();
    for (auto one = sender.waiting.begin(); one != sender.waiting.end(); ++one)
      if (one->first != keep && (oldest == sender.waiting.end() || one->second.last_s < oldest->second.last_s))
        oldest = one;
    if (oldest == sender.waiting.end()) return false;
    count(WireRefusal::incomplete);
    drop(sender, oldest, given_up);
  }
  return true;
}

void Reassembly::drop(Sender& sender, std::map<Key, IncompleteMessage>::iterator one,
                      std::vector<std::string>& given_up) {
  for (auto& [index, part] : one->second.parts) given_up.push_back(std::move(part.tag));
  sender.cost -= one->second.cost;
  waiting_bytes_ -= one->second.cost;
  sender.waiting.erase(one);
}

std::vector<std::string> Reassembly::expire(double now_s) {
  std::vector<std::string> given_up;
  for (auto& [name, sender] : senders_)
    for (auto one = sender.waiting.begin(); one != sender.waiting.end();) {
      const auto next = std::next(one);
      if (now_s - one->second.last_s > limits_.patience_s) {
        count(WireRefusal::incomplete);
        drop(sender, one, given_up);
      }
      one = next;
    }
  return given_up;
}

std::vector<std::string> Reassembly::tags() const {
  std::vector<std::string> all;
  for (const auto& [name, sender] : senders_)
    for (const auto& [key, waiting] : sender.waiting)
      for (const auto& [index, part] : waiting.parts) all.push_back(part.tag);
  return all;
}

}  // namespace mapweave::transport
