#include "live_server_state.h"
#include "results/file_shelf.h"

namespace mapweave::runtime {

LiveMapServer::State::State(TierId edge, tiers::ServerOptions server, fusion::FusionOptions fusion,
                            LiveServerOptions live, const std::optional<std::filesystem::path>& path,
                            rig::RigOptions rig)
    : options(live), maps(edge, immediate(std::move(server)), std::move(fusion), rig) {
  maps.use_shelf(
      std::make_shared<FileShelf>(path ? std::filesystem::absolute(*path).parent_path() : folder_of_temporary_files()));
  saver.emplace(path ? std::optional(restored(*path)) : std::nullopt,
                std::uint64_t{1024} * static_cast<std::uint64_t>(live.journal_kb), [this] {
                  const std::lock_guard lock(mutex);
                  has_work.notify_all();
                });
  std::thread([this] {
    lower_priority();
    merge_pool.emplace(options.merge_threads);
  }).join();
  advance();
  try {
    merger = std::thread([this] { merge_maps(); });
    for (int i = 0; i < options.handlers; ++i) handlers.emplace_back([this] { handle(); });
  } catch (...) {
    end();
    throw;
  }
}

tiers::ServerOptions LiveMapServer::State::immediate(tiers::ServerOptions options) {
  options.wait = false;
  return options;
}

mapdb::UpdateJournal LiveMapServer::State::restored(const std::filesystem::path& path) {
  mapdb::UpdateJournal journal(path);
  std::size_t count = 0;
  journal.replay([&](const mapdb::JournalEntry& entry) {
    if (entry.vetoed) return maps.veto(*entry.vetoed);
    ++count;
    try {
      maps.greet({entry.from, maps.vocabulary()});
      maps.receive(entry.from, entry.update);
    } catch (const Error& error) {
      throw Error(ErrorCode::kCorrupt, std::string("an update of it does not fit: ") + error.what(), path.string(),
                  "begin another journal; clients that are still there publish all again");
    }
  });
  const JournalSaver::Entries all = entries_of(maps.snapshot(), maps.vetoed());
  if (all.size() < count + maps.vetoed().size()) journal.replace(all);
  return journal;
}

JournalSaver::Entries LiveMapServer::State::entries_of(tiers::VisualServer::Snapshot snapshot,
                                                       const std::set<Hash>& vetoed) {
  JournalSaver::Entries entries;
  for (const Hash& judgement : vetoed) entries.push_back({{}, {}, judgement});
  for (auto& [from, update] : snapshot) entries.push_back({from, std::move(update)});
  return entries;
}

void LiveMapServer::State::finish() {
  std::call_once(finished, [this] { end(); });
}

void LiveMapServer::State::end() {
  {
    const std::lock_guard lock(mutex);
    handling_ends = true;
    has_work.notify_all();
  }
  for (std::thread& handler : handlers) handler.join();
  saver->finish();
  {
    const std::lock_guard lock(maps_mutex);
    merging_ends = true;
    maps_changed.notify_all();
  }
  if (merger.joinable()) merger.join();
  const std::lock_guard lock(mutex);
  for (const auto& wire : wires) close(*wire);
  prune();
}

LiveMapServer::LiveMapServer(TierId edge, tiers::ServerOptions server, fusion::FusionOptions fusion,
                             LiveServerOptions options, const std::optional<std::filesystem::path>& journal,
                             rig::RigOptions rig)
    : state_(std::make_shared<State>(edge, std::move(server), std::move(fusion), options, journal, rig)) {}

LiveMapServer::~LiveMapServer() { state_->finish(); }

void LiveMapServer::veto(const Hash& judgement) { state_->veto(judgement); }

void LiveMapServer::refuse(std::set<std::pair<RobotId, RobotId>> robots) {
  const State::Hold hold(*state_);
  state_->maps.refuse(std::move(robots));
}

std::optional<tiers::RobotInTeam> LiveMapServer::robot(const RobotId& robot) const {
  const State::Hold hold(*state_);
  return state_->maps.robot(robot);
}

tiers::VisualServer& LiveMapServer::finish() {
  state_->finish();
  return state_->maps;
}

}  // namespace mapweave::runtime
