#pragma once
// What a server received from its clients and has said it would keep: an SQLite file (.mwj) that grows by every update
// and survives a kill at any moment. Journals of schema 1 (without vetoes) become those of schema 2 when they are
// opened.

#include <mapweave/core/hash.h>
#include <mapweave/core/ids.h>

#include <filesystem>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace mapweave::mapdb {

struct JournalEntry {
  SessionId from;
  std::string update;               // an encoded MapUpdate
  std::optional<Hash> vetoed = {};  // instead of those: a judgement that is not to be believed
};

// One at a time has a journal open. Not thread-safe.
class UpdateJournal {
 public:
  // Opens it, or begins it. Throws Error: kCannotWrite; kCorrupt for what is no journal, or damaged; kUnsupported for a
  // newer schema; kBadInput while another process has it open.
  explicit UpdateJournal(const std::filesystem::path& path);
  // What a server left that has ended or was killed, only to be replayed: neither changed nor begun, and nothing is
  // left beside it; one that was killed is copied to the folder for temporary files first. Throws Error: kMissing;
  // kBadInput for a folder, and while a server has it open; kUnsupported and kCorrupt as above; kCannotWrite where
  // there is no room for the copy.
  static UpdateJournal left_behind(const std::filesystem::path& path);
  // The journal, and where its server was killed the log beside it: what left_behind() reads.
  static std::vector<std::filesystem::path> files_of(const std::filesystem::path& path);
  ~UpdateJournal();
  UpdateJournal(UpdateJournal&&) noexcept;
  UpdateJournal& operator=(UpdateJournal&&) noexcept;

  // All or nothing, and on the disk when it returns. Throws Error(kCannotWrite), with the free space when the disk is
  // full.
  void append(const std::vector<JournalEntry>& entries);
  // Vetoes, each once; then updates in the order they came. Throws Error(kCorrupt) for a damaged one; those before it
  // have been visited.
  void replay(const std::function<void(const JournalEntry&)>& visit);
  // What stands for all of it (each map's state in one update, and the vetoes): the journal holds that alone then. As
  // append otherwise.
  void replace(const std::vector<JournalEntry>& entries);
  std::uint64_t bytes() const;  // of the updates, as they lie in it

 private:
  struct State;
  explicit UpdateJournal(std::unique_ptr<State> state);
  std::unique_ptr<State> state_;
};

}  // namespace mapweave::mapdb
