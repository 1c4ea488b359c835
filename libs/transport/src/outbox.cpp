#include <mapweave/core/error.h>
#include <mapweave/transport/outbox.h>

#include <algorithm>
#include <utility>

namespace mapweave::transport {

void MemoryOutbox::append(Envelope envelope) {
  MAPWEAVE_EXPECT(envelope.sequence > 0, "what is kept has a number");
  bytes_ += envelope.bytes.size();
  kept_.push_back({std::move(envelope)});
}

std::vector<Envelope> MemoryOutbox::take_due() {
  std::vector<Envelope> due;
  for (Kept& one : kept_)
    if (!std::exchange(one.is_in_flight, true)) due.push_back(one.envelope);
  return due;
}

void MemoryOutbox::repeat(const std::string& sender, std::uint64_t sequence) {
  for (Kept& one : kept_)
    if (one.envelope.sequence == sequence && one.envelope.sender == sender) one.is_in_flight = false;
}

void MemoryOutbox::repeat_all() {
  for (Kept& one : kept_) one.is_in_flight = false;
}

void MemoryOutbox::forget(const std::string& sender, std::uint64_t up_to) {
  const auto is_done = [&](const Kept& one) { return one.envelope.sequence <= up_to && one.envelope.sender == sender; };
  for (const Kept& one : kept_)
    if (is_done(one)) bytes_ -= one.envelope.bytes.size();
  kept_.erase(std::remove_if(kept_.begin(), kept_.end(), is_done), kept_.end());
}

}  // namespace mapweave::transport
