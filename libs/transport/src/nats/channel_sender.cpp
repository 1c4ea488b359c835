#include <mapweave/core/error.h>
#include <mapweave/transport/channel_sender.h>

#include <algorithm>
#include <utility>

namespace mapweave::transport {
namespace {

constexpr double kFullWait_s = 0.25, kMissingWait_s = 0.2, kRefusedWait_s = 1.0;
// What may be on its path before the link was measured, and at most; and how long parts take to send.
constexpr std::size_t kFirstWindow = 128 << 10, kLeastWindow = 32 << 10, kMostWindow = 2 << 20;
constexpr std::size_t kFirstPart = 64 << 10, kLeastPart = 16 << 10;
constexpr double kWindow_s = 1.0, kPart_s = 0.25;

std::size_t bytes_in(const Bandwidth& bandwidth, double seconds, std::size_t least, std::size_t most) {
  const double bytes =
      std::clamp(bandwidth.bytes_per_s * seconds, static_cast<double>(least), static_cast<double>(most));
  return static_cast<std::size_t>(bytes);
}

}  // namespace

ChannelSender::ChannelSender(ChannelSenderOptions options) : options_(options), classes_(options.priorities) {
  MAPWEAVE_EXPECT(options.priorities > 0 && options.priorities <= 16, "one to 16 classes");
}

void ChannelSender::begin(std::uint64_t session) {
  MAPWEAVE_EXPECT(session_ == 0 && session != 0, "a session begins once");
  session_ = session;
}

std::size_t ChannelSender::window() const {
  const auto measured = to_broker_.estimate();
  return measured ? bytes_in(*measured, kWindow_s, kLeastWindow, kMostWindow) : kFirstWindow;
}

std::size_t ChannelSender::part_bytes() const {
  const auto measured = to_broker_.estimate();
  return measured ? bytes_in(*measured, kPart_s, kLeastPart, kMostPartBytes) : kFirstPart;
}

Channel::Sent ChannelSender::put(Envelope envelope, std::size_t priority, WireKind kind) {
  Class& one = classes_.at(priority);
  const std::size_t size = envelope.bytes.size();
  if (envelope.subject.size() > kMostWireNameBytes || envelope.sender.size() > kMostWireNameBytes ||
      size > std::min(options_.limits.bytes, options_.message_bytes))
    return Channel::Sent::never;
  if (envelope.last_counts) {
    const auto replaced = std::find_if(one.messages.begin(), one.messages.end(), [&](const Outgoing& waiting) {
      return !waiting.message && waiting.kind == kind && waiting.envelope.last_counts &&
             waiting.envelope.subject == envelope.subject && waiting.envelope.sender == envelope.sender;
    });
    if (replaced != one.messages.end()) {
      bytes_ += size - replaced->bytes;
      replaced->bytes = size;
      replaced->envelope = std::move(envelope);
      return Channel::Sent::taken;
    }
  }
  if (kind == WireKind::message && (bytes_ + size > options_.limits.bytes || messages_ >= options_.limits.messages))
    return Channel::Sent::later;
  Outgoing message;
  message.envelope = std::move(envelope);
  message.kind = kind;
  message.bytes = size;
  one.messages.push_back(std::move(message));
  bytes_ += size;
  ++messages_;
  return Channel::Sent::taken;
}

void ChannelSender::begin(Outgoing& message, std::size_t priority, std::uint64_t number) const {
  message.message = std::make_unique<WireMessage>(std::move(message.envelope), message.kind,
                                                  static_cast<std::uint8_t>(priority), session_, number, part_bytes());
  message.envelope = {};
  message.parts.resize(message.message->header().parts);
}

std::optional<ChannelSender::MessagePart> ChannelSender::next(double now_s) {
  if (session_ == 0) return std::nullopt;
  if (!flying_.empty() && flying_bytes_ >= window()) return std::nullopt;
  for (std::size_t priority = 0; priority < classes_.size(); ++priority)
    if (classes_[priority].held_up_until_s <= now_s)
      if (auto part = next_of(priority, now_s)) return part;
  return std::nullopt;
}

std::optional<ChannelSender::MessagePart> ChannelSender::next_of(std::size_t priority, double now_s) {
  Class& one = classes_[priority];
  for (one.first_due = std::max(one.first_due, one.first); one.first_due < one.first + one.messages.size();
       ++one.first_due) {
    const std::uint64_t number = one.first_due;
    Outgoing& message = one.messages[number - one.first];
    if (!message.message) begin(message, priority, number);
    for (std::uint32_t index = 0; index < message.parts.size(); ++index) {
      PartProgress& progress = message.parts[index];
      if (progress.state != PartState::due) continue;
      MessagePart part;
      part.token = ++tokens_;
      part.priority = priority;
      part.bytes = message.message->part(index);
      part.message_id = std::to_string(session_) + "." + std::to_string(priority) + "." + std::to_string(number) + "." +
                        std::to_string(index) + "." + to_hex(message.message->header().hash).substr(0, 8);
      progress = {PartState::flying, 0, part.token, now_s};
      flying_.emplace(part.token, Flying{priority, number, index, part.bytes.size()});
      flying_bytes_ += part.bytes.size();
      to_broker_.sent(part.bytes.size(), now_s);
      return part;
    }
  }
  return std::nullopt;
}

ChannelSender::PartProgress* ChannelSender::progress_of(const Flying& flying) {
  Class& one = classes_[flying.priority];
  if (flying.number < one.first || flying.number - one.first >= one.messages.size()) return nullptr;
  return &one.messages[flying.number - one.first].parts.at(flying.part);
}

void ChannelSender::not_sent(std::uint64_t token) {
  const auto known = flying_.find(token);
  if (known == flying_.end()) return;
  if (PartProgress* const progress = progress_of(known->second); progress && progress->token == token) {
    progress->state = PartState::due;
    Class& one = classes_[known->second.priority];
    one.first_due = std::min(one.first_due, known->second.number);
  }
  flying_bytes_ -= known->second.bytes;
  flying_.erase(known);
  to_broker_.lost();
}

void ChannelSender::published(std::uint64_t token, const Publication& publication, double now_s) {
  const auto known = flying_.find(token);
  if (known == flying_.end()) return;
  const Flying flying = known->second;
  if (publication.outcome != Publication::Outcome::stored) {
    not_sent(token);
    Class& one = classes_[flying.priority];
    trouble_ = publication.reason;
    one.has_no_stream = publication.outcome == Publication::Outcome::no_stream;
    const bool is_full = publication.outcome == Publication::Outcome::full;
    if (is_full && !full_since_s_) full_since_s_ = now_s;
    one.held_up_until_s = now_s + (is_full ? kFullWait_s : one.has_no_stream ? kMissingWait_s : kRefusedWait_s);
    return;
  }
  flying_bytes_ -= flying.bytes;
  flying_.erase(known);
  to_broker_.confirmed(flying.bytes, now_s);
  Class& one = classes_[flying.priority];
  one.has_no_stream = false;
  trouble_.clear();
  full_since_s_.reset();
  // Numbers rise but in a stream that is another one.
  if (!publication.is_repetition && publication.number <= std::exchange(one.last_stored, publication.number))
    stream_lost(flying.priority);
  one.last_stored = publication.is_repetition ? std::max(one.last_stored, publication.number) : publication.number;
  PartProgress* const progress = progress_of(flying);
  if (progress == nullptr) return;
  progress->state = PartState::stored;
  progress->stored_as = publication.number;
  to_receiver_.sent(flying.bytes, now_s);
}

void ChannelSender::lost() {
  while (!flying_.empty()) not_sent(flying_.begin()->first);
  to_broker_.lost();
}

void ChannelSender::stream_lost(std::size_t priority) {
  Class& one = classes_.at(priority);
  for (Outgoing& message : one.messages)
    for (PartProgress& part : message.parts)
      if (part.state == PartState::stored) part.state = PartState::due;
  one.first_due = one.first;
  one.last_stored = 0;
  one.has_no_stream = false;
  to_receiver_.lost();
}

void ChannelSender::acknowledged(std::size_t priority, std::uint64_t number, double now_s) {
  Class& one = classes_.at(priority);
  const auto is_done = [&](const Outgoing& message) {
    return message.message && std::all_of(message.parts.begin(), message.parts.end(), [&](const PartProgress& part) {
             return part.state == PartState::stored && part.stored_as <= number;
           });
  };
  while (!one.messages.empty() && is_done(one.messages.front())) {
    const Outgoing& done = one.messages.front();
    std::size_t sent = 0;
    for (std::uint32_t i = 0; i < done.parts.size(); ++i) sent += done.message->part_size(i);
    to_receiver_.confirmed(sent, now_s);
    bytes_ -= done.bytes;
    --messages_;
    one.messages.pop_front();
    ++one.first;
  }
}

std::size_t ChannelSender::expire(double now_s) {
  std::vector<std::uint64_t> late;
  for (const auto& [token, flying] : flying_) {
    const PartProgress* const progress = progress_of(flying);
    if (progress == nullptr || now_s - progress->since_s > options_.confirm_s) late.push_back(token);
  }
  for (const std::uint64_t token : late) not_sent(token);
  return late.size();
}

bool ChannelSender::is_idle() const {
  return std::all_of(classes_.begin(), classes_.end(), [](const Class& one) {
    return std::all_of(one.messages.begin(), one.messages.end(), [](const Outgoing& message) {
      return message.message && std::all_of(message.parts.begin(), message.parts.end(),
                                            [](const PartProgress& part) { return part.state == PartState::stored; });
    });
  });
}

}  // namespace mapweave::transport
