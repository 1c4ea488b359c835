#include "live_server_state.h"

#include <mapweave/core/interrupt.h>
#include <mapweave/core/log.h>

namespace mapweave::runtime {
namespace {

// But for those in names: what they count grows from merge to merge, while the note itself stays the same.
std::string without_numbers(const std::string& note) {
  std::string rest;
  bool is_quoted = false;
  for (const char letter : note) {
    if (letter == '\'') is_quoted = !is_quoted;
    if (is_quoted || letter < '0' || letter > '9') rest += letter;
  }
  return rest;
}

// Why it failed; empty: it did not.
template <class Work>
std::string trouble_of(const Work& work) {
  try {
    work();
  } catch (const Interrupted& interrupted) {
    return interrupted.message();
  } catch (const std::exception& error) {
    return error.what();
  }
  return {};
}

}  // namespace

void LiveMapServer::State::advance() {
  maps.advance({std::chrono::duration_cast<std::chrono::nanoseconds>(Clock::now().time_since_epoch()).count()},
               *merge_pool, !merger_is_busy);
  if (maps.pending()) maps_changed.notify_one();
}

void LiveMapServer::State::merge_maps() {
  lower_priority();
  std::unique_lock lock(maps_mutex);
  while (true) {
    maps_changed.wait(lock, [&] { return merging_ends || maps.pending(); });
    if (merging_ends) return;
    std::shared_ptr<BackgroundWork> work = maps.pending();
    merger_is_busy = true;
    lock.unlock();
    const Clock::time_point begin = Clock::now();
    double spent_s = 0.0;
    const std::string trouble = trouble_of([&] {
      const Spending spending(spent_s);
      work->run();
    });
    const double lasted_s = seconds_since(begin);
    std::vector<std::string> notes;
    const std::string later = trouble_of([&] {
      const Hold hold(*this);
      if (trouble.empty()) {
        advance();
        notes = maps.notes();
      } else {
        maps.abandon();
      }
    });
    work.reset();  // with what is no longer known
    note_merge(spent_s, lasted_s, trouble.empty() ? later : trouble, std::move(notes));
    lock.lock();
    maps_changed.wait_for(lock,
                          std::chrono::duration<double>(lasted_s * (1.0 / std::max(0.01, options.merge_share) - 1.0)),
                          [&] { return merging_ends; });
    merger_is_busy = false;
    if (const std::string last = trouble_of([&] { advance(); }); !last.empty()) maps.abandon();
  }
}

void LiveMapServer::State::note_merge(double spent_s, double lasted_s, const std::string& trouble,
                                      std::vector<std::string> notes) {
  if (!trouble.empty()) log(LogLevel::error, "the maps could not be merged: " + trouble);
  for (const std::string& note : notes)
    if (noted.insert(without_numbers(note)).second) log(LogLevel::warning, note);
  const std::lock_guard counting(mutex);
  if (trouble.empty()) {
    ++counts.merges;
    counts.notes = std::move(notes);
  }
  counts.merging_s += spent_s;
  counts.trouble = trouble;
  counts.longest_merge_s = std::max(counts.longest_merge_s, lasted_s);
}

}  // namespace mapweave::runtime
