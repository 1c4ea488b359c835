#include "sharing_cameras.h"

#include "robots/shared_cameras.h"

#include <mapweave/core/log.h>

#include <algorithm>
#include <chrono>
#include <thread>
#include <utility>

namespace mapweave::runtime {
namespace {

using Clock = std::chrono::steady_clock;

constexpr std::chrono::milliseconds kTurn{20};

double seconds_from(Clock::time_point then) { return std::chrono::duration<double>(Clock::now() - then).count(); }

}  // namespace

SharingCameras::SharingCameras(const RobotId& robot, const RunConfiguration& configuration, const LiveOptions& live,
                               Connect connect)
    : robot_(robot),
      options_{configuration.uplink, configuration.visual.chosen_vocabulary.get().hash(),
               configuration.server.share_rate_hz, live.wire.repeat_s},
      patience_s_(live.patience_s),
      connect_(std::move(connect)) {}

CameraLink& SharingCameras::link_of(const CameraTask::Client& client) {
  const auto known = std::find_if(links_.begin(), links_.end(),
                                  [&](const CameraLink& link) { return link.place().client == client.place.client; });
  if (known != links_.end()) return *known;
  const std::lock_guard lock(mutex_);
  return links_.emplace_back(client.place, options_);
}

void SharingCameras::exchange(const std::vector<CameraTask::Client>& clients, Stamp now) {
  if (!first_) first_ = now;
  last_ = now;
  bool has_news = false;
  for (const CameraTask::Client& client : clients) has_news = link_of(client).exchange(*client.client, now) || has_news;
  if (has_news) count(clients);
}

void SharingCameras::finish(const std::vector<CameraTask::Client>& clients, const std::atomic<bool>& give_up) {
  for (const CameraTask::Client& client : clients) finish(client, give_up);
  count(clients);
}

void SharingCameras::finish(const CameraTask::Client& client, const std::atomic<bool>& give_up) {
  CameraLink& link = link_of(client);
  visual::VisualClient& camera = *client.client;
  const bool lacks = !camera.forgotten_keyframes(client.place).empty();
  const Clock::time_point began = Clock::now();
  Clock::time_point said = began;
  while (!give_up) {
    const bool is_published = !link.publish_rest(camera, kTurn);
    if (is_published && (!lacks || link.fetch_kept(camera, kTurn))) break;
    if (!lacks && (link.is_cut() || seconds_from(began) >= patience_s_)) break;
    if (!link.is_welcome() && !link.refusal().empty()) break;
    if (link.is_cut()) std::this_thread::sleep_for(kTurn);
    if (seconds_from(said) < patience_s_) continue;
    said = Clock::now();
    log(LogLevel::warning, "robot " + robot_.str() + ": camera '" + client.place.client.sensor.str() +
                               "' has forgotten keyframes that its edge's camera map server keeps, and waits for them");
  }
  *client.kept = link.take_kept();
}

std::vector<std::string> SharingCameras::notes() const {
  std::vector<std::string> notes;
  for (std::size_t i = 0; i < links_.size(); ++i) {
    const CameraLink& link = links_[i];
    const std::string who = "robot " + robot_.str() + ": camera '" + link.place().client.sensor.str() + "'";
    if (i >= kMostSharingCameras)
      notes.push_back(who + " mapped alone: " + std::to_string(kMostSharingCameras) +
                      " cameras of a robot share while they drive");
    else if (!link.refusal().empty())
      notes.push_back(who + " shared not all that it could: its edge's camera map server refused: " + link.refusal());
    else if (link.agent().sent_bytes() == 0)
      notes.push_back(who + " mapped alone: its edge's camera map server did not answer while it drove");
  }
  return notes;
}

void SharingCameras::keep_wires() {
  std::vector<std::pair<int, CameraLink*>> cut;
  {
    const std::lock_guard lock(mutex_);
    for (std::size_t i = 0; i < std::min(links_.size(), kMostSharingCameras); ++i)
      if (links_[i].is_cut()) cut.emplace_back(static_cast<int>(i), &links_[i]);
  }
  for (const auto& [number, link] : cut)
    if (auto channel = connect_(number); channel && !channel->is_closed()) link->use(std::move(channel));
}

void SharingCameras::count(const std::vector<CameraTask::Client>& clients) {
  LiveRobotCounts::Sharing counts;
  for (const CameraTask::Client& client : clients) {
    const CameraLink& link = link_of(client);
    count_sharing(*client.client, link.agent(), static_cast<std::uint64_t>(seconds_between(*first_, *last_)),
                  *client.report);
    ++counts.cameras;
    counts.on_wire += link.is_welcome() && !link.is_cut() ? 1 : 0;
    counts.sent_bytes += client.report->sent_bytes;
    counts.received_bytes += client.report->received_bytes;
    counts.shared_keyframes += client.report->shared_keyframes;
    counts.borrowed += client.report->borrowed;
    if (!link.refusal().empty()) counts.refusal = link.refusal();
  }
  const std::lock_guard lock(mutex_);
  counts_ = std::move(counts);
}

LiveRobotCounts::Sharing SharingCameras::counts() const {
  const std::lock_guard lock(mutex_);
  return counts_;
}

}  // namespace mapweave::runtime
