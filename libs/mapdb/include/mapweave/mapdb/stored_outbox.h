#pragma once
// What a sender keeps until the receiver has said that it has it, in an SQLite file (.mwo) that survives a kill at any
// moment and an outage of any length.

#include <mapweave/transport/outbox.h>

#include <filesystem>
#include <memory>

namespace mapweave::mapdb {

// After a restart all that it holds is due again: receivers take what they have for nothing new. One at a time has it
// open. Not thread-safe.
class StoredOutbox : public transport::Outbox {
 public:
  // Opens it, or begins it. There is room while what lies in it (compressed) has less than most_bytes. Throws Error:
  // kCannotWrite; kCorrupt for what is no outbox, or damaged; kUnsupported for a newer schema; kBadInput while another
  // process has it open.
  StoredOutbox(const std::filesystem::path& path, std::uint64_t most_bytes);
  ~StoredOutbox() override;
  StoredOutbox(StoredOutbox&&) noexcept;
  StoredOutbox& operator=(StoredOutbox&&) noexcept;

  bool has_room() const override;
  // On the disk when it returns. Contract: each sender's numbers rise, also over restarts (last_number()). Throws
  // Error(kCannotWrite), with the free space when the disk is full: nothing is appended then, nothing lost.
  void append(transport::Envelope envelope) override;
  // As Outbox, but at most so many bytes of messages in one call, or a single longer one: call again for the rest.
  // Throws Error(kCorrupt) for a message that is damaged, which stays in flight: the others are due.
  static constexpr std::size_t kMostDueBytes = std::size_t{8} << 20;
  std::vector<transport::Envelope> take_due() override;
  void repeat(const std::string& sender, std::uint64_t sequence) override;
  void repeat_all() override;
  // On the disk when it returns. Where the disk is too full for that, they are not due any more, and leave the file
  // with the next forget() or append() that can be written; until then they take room.
  void forget(const std::string& sender, std::uint64_t up_to) override;
  std::size_t bytes() const override;  // compressed, as they lie in it

  // The highest number that was ever appended of a sender, forgotten or not; 0: none.
  std::uint64_t last_number(const std::string& sender) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace mapweave::mapdb
