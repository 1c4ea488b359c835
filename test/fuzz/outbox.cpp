// What a sender keeps on disk until it is confirmed (.mwo).

#include "fuzz_target.h"

#include <mapweave/mapdb/stored_outbox.h>

namespace mapweave::fuzz {
namespace {

constexpr std::uint64_t kRoom = 1 << 20;

transport::Envelope message(const std::string& sender, std::uint64_t sequence, std::size_t bytes) {
  transport::Envelope envelope{"update", std::string(bytes, 'x')};
  envelope.sender = sender;
  envelope.sequence = sequence;
  return envelope;
}

}  // namespace

std::vector<std::string> seeds() {
  clear_scratch();
  const auto path = scratch_folder() / "sound.mwo";
  {
    mapdb::StoredOutbox outbox(path, kRoom);
    outbox.append(message("alpha", 1, 10));
    outbox.append(message("alpha", 2, 5000));
    outbox.append(message("beta", 9, 0));
  }
  return {file_bytes(path)};
}

void decode(std::string_view bytes) {
  clear_scratch();
  mapdb::StoredOutbox outbox(scratch_file("input.mwo", bytes), kRoom);
  for (std::size_t taken = 1; taken > 0;) taken = outbox.take_due().size();
  outbox.repeat_all();
  if (outbox.has_room()) outbox.append(message("alpha", outbox.last_number("alpha") + 1, 10));
  outbox.forget("alpha", 1);
  outbox.forget("beta", 9);
}

}  // namespace mapweave::fuzz
