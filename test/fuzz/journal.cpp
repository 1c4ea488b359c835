// Journals of servers (.mwj): opened to go on with, and read where a server was killed.

#include "fuzz_target.h"

#include <mapdb/stored.h>
#include <mapweave/mapdb/update_journal.h>

namespace mapweave::fuzz {
namespace {

using namespace mapdb;

const SessionId kSession{{RobotId("alpha"), SensorId("camera")}, 42};

void replay(UpdateJournal& journal) {
  journal.replay([](const JournalEntry& entry) {
    expect(entry.vetoed || is_valid_name(entry.from.client.robot.str()), "an update is of a robot");
  });
}

void go_on(std::string_view bytes) {
  clear_scratch();
  UpdateJournal journal(scratch_file("input.mwj", bytes));
  replay(journal);
  journal.append({{kSession, "more"}});
}

void read_left_behind(std::string_view bytes) {
  clear_scratch();
  UpdateJournal journal = UpdateJournal::left_behind(scratch_file("input.mwj", bytes));
  replay(journal);
}

std::string sound_journal() {
  clear_scratch();
  const auto path = scratch_folder() / "sound.mwj";
  {
    UpdateJournal journal(path);
    journal.append({{kSession, "an update"}, {kSession, std::string(3000, 'x')}});
    journal.append({{{}, {}, hash_of_bytes("vetoed")}});
    journal.replace({{kSession, "an update"}, {{}, {}, hash_of_bytes("vetoed")}});
  }
  return file_bytes(path);
}

const std::vector<Kind>& kinds() {
  static const std::vector<Kind> all = {{go_on, {sound_journal()}}, {read_left_behind, {sound_journal()}}};
  return all;
}

}  // namespace

std::vector<std::string> seeds() { return seeds_of(kinds()); }
void decode(std::string_view bytes) { decode_one_of(kinds(), bytes); }

}  // namespace mapweave::fuzz
