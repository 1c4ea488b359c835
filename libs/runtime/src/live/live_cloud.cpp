#include "live_cloud_state.h"

#include <mapweave/core/log.h>
#include <mapweave/core/stopwatch.h>
#include <mapweave/tiers/subjects.h>
#include <mapweave/transport/in_process_channel.h>

#include <algorithm>

namespace mapweave::runtime {
namespace {

namespace subject = tiers::subject;

constexpr std::chrono::milliseconds kStep{20};
constexpr std::size_t kMostInFlight = std::size_t{64} << 20;
constexpr std::size_t kMostSaid = 4096;  // messages of one edge that may wait to be merged
constexpr char kEdge[] = "edge", kCloud[] = "cloud";

bool is_of_preview(const std::string& what) {
  return what == subject::kPreviewUpdate || what == subject::kPreviewMerged || what == subject::kPreviewEnd;
}

// As the journal keeps it: subject, number and bytes.
std::string framed(const Said& said) { return said.subject + "\n" + std::to_string(said.number) + "\n" + said.bytes; }

Said unframed(const std::string& bytes, const std::string& where) {
  const std::size_t subject_end = bytes.find('\n'), number_end = bytes.find('\n', subject_end + 1);
  Said said;
  if (subject_end != std::string::npos && number_end != std::string::npos) {
    const std::string number = bytes.substr(subject_end + 1, number_end - subject_end - 1);
    constexpr std::size_t kMostDigits = 18;
    if (!number.empty() && number.size() <= kMostDigits && number.find_first_not_of("0123456789") == std::string::npos)
      said.number = std::stoull(number);
  }
  if (said.number == 0)
    throw Error(ErrorCode::kCorrupt, "a message without a number", where,
                "begin another journal; edges that are still there send all again");
  said.subject = bytes.substr(0, subject_end);
  said.bytes = bytes.substr(number_end + 1);
  return said;
}

}  // namespace

LiveCloud::State::State(const LiveSite& of, const RunSettings& how)
    : site(of),
      settings(how),
      agreement(agreement_of(of.configuration)),
      began(now_ns()),
      is_coordinated(of.configuration.coordinator.method.has_value()),
      options(of.options),
      plan(of.plan),
      team(site.configuration, site.plan, settings, site.pool, site.progress),
      rounds(cloud_tier(), site.configuration.fusion),
      keeps_previews(of.keeps_previews || of.options.page_port != 0) {
  for (const TierId& id : site.plan.edges) edges[id];
  if (site.journal) {
    journal.emplace(*site.journal);
    replay();
  }
  saver.emplace(std::move(journal), JournalSaver::kNeverLong, [] {});
  speaker = std::thread([this] { speak(); });
  merger = std::thread([this] { merge(); });
}

LiveCloud::State::~State() {
  {
    const std::lock_guard lock(mutex);
    ends = true;
    changed.notify_all();
  }
  speaker.join();
  merger.join();
  saver->finish();
}

void LiveCloud::State::replay() {
  journal->replay([&](const mapdb::JournalEntry& entry) {
    if (entry.vetoed) return;
    const auto edge = edges.find(TierId(entry.from.client.robot.str()));
    if (edge == edges.end()) return;  // the configuration has no such edge any more
    Said said = unframed(entry.update, site.journal->string());
    edge->second.session = entry.from;
    edge->second.taken = edge->second.stored = said.number;
    if (is_new(said)) edge->second.said.push_back(std::move(said));
  });
}

// What an edge that began anew says again counts once; that it has answered counts each time.
bool LiveCloud::State::is_new(const Said& said) {
  if (is_coordinated) return true;  // final_begin says what holds no longer
  if (said.bytes.empty() || is_of_preview(said.subject)) return true;
  return known.insert(Hasher().add(said.subject).add(said.bytes).finish()).second;
}

std::uint64_t LiveCloud::State::greet(Link& link, const Hello& hello) {
  const SessionId& session = hello.session;
  const auto found = edges.find(TierId(session.client.robot.str()));
  if (found == edges.end() || session.client.sensor != SensorId(kEdge)) {
    std::string names;
    for (const auto& entry : edges) names += (names.empty() ? "" : ", ") + entry.first.str();
    throw Error(ErrorCode::kBadInput, "'" + session.client.robot.str() + "' is no edge of this configuration", {},
                "its edges are: " + names);
  }
  Edge& edge = found->second;
  for (Link& other : links)
    if (&other != &link && other.edge == &edge && !other.is_closed && other.wire->is_open()) {
      log(LogLevel::warning,
          "the cloud: edge " + found->first.str() + " came on another wire; the one before is closed");
      other.is_closed = true;
    }
  if (!edge.session || *edge.session != session) {
    if (edge.session) log(LogLevel::info, "the cloud: edge " + found->first.str() + " began anew");
    edge.session = session;
    edge.taken = edge.stored = 0;
    edge.is_forgotten = true;
    edge.said.erase(std::remove_if(edge.said.begin(), edge.said.end(),
                                   [](const Said& said) { return is_of_preview(said.subject); }),
                    edge.said.end());
    ++edge.runs;
  }
  link.edge = &edge;
  return edge.stored;
}

void LiveCloud::State::take(Link& link, Said said) {
  Edge& edge = *link.edge;
  if (said.number <= edge.taken) return;  // on a wire before
  edge.taken = said.number;
  const bool counts_now = is_new(said);
  std::vector<mapdb::JournalEntry> entries;
  if (counts_now && !is_of_preview(said.subject)) entries.push_back({*edge.session, framed(said)});
  saver->save(std::move(entries), [this, stored = Stored{&edge, *edge.session, said.number}] {
    const std::lock_guard lock(stored_mutex);
    newly_stored.push_back(stored);
    changed.notify_all();
  });
  if (counts_now) edge.said.push_back(std::move(said));
  changed.notify_all();
}

void LiveCloud::State::say_requests(Link& link) {
  for (; link.asked < link.edge->requests.size(); ++link.asked) {
    const auto& [subject, bytes] = link.edge->requests[link.asked];
    link.wire->append(subject, bytes);
  }
}

void LiveCloud::State::step(Clock::time_point now) {
  {
    const std::lock_guard lock(stored_mutex);
    for (const Stored& stored : newly_stored)
      if (stored.edge->session == stored.session) stored.edge->stored = std::max(stored.edge->stored, stored.number);
    newly_stored.clear();
  }
  for (Link& link : links) {
    if (link.edge != nullptr) {
      link.wire->store(link.edge->stored);
      say_requests(link);
    }
    if (!link.is_closed) link.wire->step(now, link.edge != nullptr && link.edge->said.size() >= kMostSaid);
    if (link.edge != nullptr) link.edge->received_at = link.wire->received_at();
    link.is_closed = link.is_closed || !link.wire->is_open();
    if (link.edge != nullptr)
      link.edge->has_all = link.wire->is_all_confirmed() && link.asked == link.edge->requests.size();
    if (!link.is_closed) continue;
    link.wire->close();
    add_counts(link.wire->counts(), counts);
    if (link.edge != nullptr) add_counts(link.wire->health(), link.edge->wire_before);
  }
  links.remove_if([](const Link& link) { return link.is_closed; });
}

bool LiveCloud::State::is_needed(const TierId& edge) const {
  return !is_coordinated || (newest_plan.number > 0 && !newest_plan.members(edge).empty());
}

bool LiveCloud::State::has_its_finals(const TierId& id, const Edge& edge) const {
  return edge.has_fused && (!is_coordinated || edge.members == newest_plan.members(id));
}

void LiveCloud::State::say_who_is_missing() const {
  if (counts.is_done) return;
  for (const auto& [name, edge] : edges) {
    const bool is_here = std::any_of(
        links.begin(), links.end(), [&edge = edge](const Link& link) { return link.edge == &edge && !link.is_closed; });
    if (!is_here && is_needed(name) && !has_its_finals(name, edge))
      log(LogLevel::warning, "the cloud waits for edge " + name.str() + ": it is not on the wire");
  }
}

void LiveCloud::State::speak() {
  std::unique_lock lock(mutex);
  auto said = Clock::now();
  while (!ends) {
    const auto now = Clock::now();
    step(now);
    if (std::chrono::duration<double>(now - said).count() >= options.patience_s) {
      said = now;
      say_who_is_missing();
    }
    changed.wait_for(lock, kStep);
  }
}

LiveCloud::LiveCloud(const LiveSite& site, const RunSettings& settings) : state_(new State(site, settings)) {}
LiveCloud::~LiveCloud() = default;

std::shared_ptr<transport::Channel> LiveCloud::connect() {
  const auto channel = transport::make_in_process_channel({kMostInFlight});
  serve(channel.second);
  return channel.first;
}

void LiveCloud::use(const LiveOptions& options) {
  const std::lock_guard lock(state_->mutex);
  state_->options.take_while_running(options);
  state_->keeps_previews = state_->site.keeps_previews || options.page_port != 0;
  state_->has_new_options = true;
  state_->changed.notify_all();
}

void LiveCloud::serve(std::shared_ptr<transport::Channel> edge) {
  State& state = *state_;
  edge->set_listener([woken = state.woken] { woken->notify_all(); });
  const std::lock_guard lock(state.mutex);
  if (state.links.size() >= kMostLinks) return edge->close();
  State::Link& link = state.links.emplace_back();
  link.wire.emplace(SessionId{{RobotId(cloud_tier().str()), SensorId(kCloud)}, state.began}, state.agreement, "an edge",
                    state.site.options.wire,
                    WireHooks{[&state, &link](const Hello& hello) { return state.greet(link, hello); },
                              [&state, &link](Said said) { state.take(link, std::move(said)); },
                              [&link] {  // an edge that began anew gets all requests again
                                link.wire->begin_anew(link.wire->self());
                                link.asked = 0;
                              }});
  link.wire->use(std::move(edge));
}

bool LiveCloud::follow(const LiveRequests& requests) {
  const std::lock_guard lock(state_->mutex);
  if (state_->counts.is_sealing) return false;
  state_->asked_for = requests;
  state_->has_new_requests = true;
  return true;
}

void LiveCloud::follow(const LivePlan& plan) {
  State& state = *state_;
  const std::lock_guard lock(state.mutex);
  if (plan.number <= state.newest_plan.number || (plan.is_done && state.newest_plan.number == 0)) return;
  state.newest_plan = plan;
  state.has_new_plan = true;
  state.changed.notify_all();
}

void LiveCloud::seal_now() {
  const std::lock_guard lock(state_->mutex);
  state_->seals_now = true;
  state_->changed.notify_all();
}

std::optional<Report> LiveCloud::wait(std::chrono::milliseconds patience) {
  std::unique_lock lock(state_->mutex);
  state_->changed.wait_for(lock, patience, [&] { return state_->report.has_value() || state_->trouble != nullptr; });
  if (state_->trouble) std::rethrow_exception(state_->trouble);
  return state_->report;
}

std::shared_ptr<const LivePreview> LiveCloud::preview() const {
  const std::lock_guard lock(state_->mutex);
  return state_->shown;
}

LiveCloudCounts LiveCloud::counts() const {
  const State& state = *state_;
  const std::lock_guard lock(state.mutex);
  LiveCloudCounts counts = state.counts;
  counts.plan = state.newest_plan.number;
  for (const State::Link& link : state.links) {
    add_counts(link.wire->counts(), counts);
    if (link.edge == nullptr) counts.wire_troubles.insert(link.wire->health().trouble);
  }
  counts.wire_troubles.erase("");
  if (counts.trouble.empty()) counts.trouble = state.saver->trouble();
  for (const auto& [name, edge] : state.edges) {
    LiveCloudCounts::EdgeCounts& one = counts.edges.emplace_back();
    one = {name,
           edge.taken,
           edge.stored,
           false,
           state.has_its_finals(name, edge),
           edge.has_all,
           edge.runs,
           seconds_since(edge.received_at),
           state.is_needed(name),
           {}};
    for (const State::Link& link : state.links) {
      if (link.edge != &edge || link.is_closed) continue;
      one.is_on_wire = true;
      one.wire = link.wire->health();
    }
    add_counts(edge.wire_before, one.wire);
  }
  return counts;
}

}  // namespace mapweave::runtime
