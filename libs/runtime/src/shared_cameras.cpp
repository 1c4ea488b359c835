#include "shared_cameras.h"

#include <mapweave/core/log.h>
#include <mapweave/tiers/camera_agent.h>
#include <mapweave/tiers/visual_server.h>

#include <algorithm>
#include <deque>

namespace mapweave::runtime {
namespace {

// One camera's end of the wire; everything goes through the bytes that a network would carry.
class Link {
 public:
  Link(const CameraTask::Client& client, const RunConfiguration& configuration)
      : client_(client.client),
        report_(client.report),
        agent_(client.place, configuration.uplink),
        place_(client.place),
        vocabulary_(configuration.visual.chosen_vocabulary.get().hash()) {}

  // Its maps, and where it is.
  void publish(tiers::VisualServer& server, Stamp now) {
    const auto run = client_->run(place_);
    if (!run) return;
    if (!greeted_) {
      const std::string hello = encode(Hello{*run, vocabulary_});
      agent_.reconnected(*client_, decode_receipts(encode(server.greet(decode_hello(hello, "hello"))), "welcome"));
      greeted_ = true;
    }
    for (const transport::Envelope& update : agent_.updates(*client_, now)) {
      const std::string answer = encode(std::vector<Receipt>{server.receive(*run, update.bytes).receipt});
      for (const Receipt& receipt : decode_receipts(answer, "receipt")) agent_.stored(receipt);
    }
    has_place_ = false;
    if (const auto view = agent_.view(*client_)) {
      has_place_ = true;
      if (const auto share = server.share(*run, decode_client_view(*view, "view")))
        agent_.receive_share(*client_, encode(*share));
    }
    count();
  }

  // Where it is, if it does not know, once the other cameras of its rig have said where they are.
  void ask(tiers::VisualServer& server, WorkerPool& pool) {
    const auto run = client_->run(place_);
    if (!run || has_place_) return;
    if (const auto request = agent_.place_request(*client_))
      if (const auto answer = server.place(*run, decode_place_request(*request, "place request"), pool))
        agent_.receive_place(*client_, encode(*answer));
    count();
  }

 private:
  void count() {
    report_->sent_bytes = agent_.sent_bytes();
    report_->received_bytes = agent_.received_bytes();
    report_->borrowed = std::max(report_->borrowed, std::uint64_t{client_->borrowed_seen()});
  }

  visual::VisualClient* client_;
  CameraReport* report_;
  tiers::CameraAgent agent_;
  visual::ClientPlace place_;
  Hash vocabulary_;
  bool greeted_ = false, has_place_ = false;
};

struct Member {
  RobotId robot;
  CameraTask task;
  std::vector<Link> links;  // of the task's clients, which come one after the other
};

// All robots of one edge, a moment at a time.
void drive(std::deque<Member>& members, const RunConfiguration& configuration, const TierId& edge,
           const std::vector<Map>& starts, WorkerPool& pool) {
  tiers::VisualServer server(edge, configuration.server, configuration.fusion, configuration.rig);
  server.begin_with(starts);
  const auto period_ns = static_cast<std::int64_t>(1e9 / configuration.server.share_rate_hz);
  const std::atomic<bool> give_up{false};
  for (std::optional<Stamp> moment;;) {
    std::optional<Stamp> earliest;
    for (const Member& member : members)
      if (const auto next = member.task.next(); next && (!earliest || *next < *earliest)) earliest = next;
    if (!earliest) return;
    if (!moment || *moment < *earliest) moment = earliest;  // nothing happens in between
    moment->ns += period_ns;
    pool.for_each(members.size(), [&](std::size_t i) { members[i].task.advance(moment, give_up); });
    for (Member& member : members) {
      const auto clients = member.task.clients();
      while (member.links.size() < clients.size())
        member.links.emplace_back(clients[member.links.size()], configuration);
      for (Link& link : member.links) link.publish(server, *moment);
    }
    for (Member& member : members)
      for (Link& link : member.links) link.ask(server, pool);
    server.advance(*moment, pool);
  }
}

}  // namespace

std::map<RobotId, CamerasOutcome> map_shared_cameras(const RunConfiguration& configuration, const RunPlan& plan,
                                                     const std::vector<Map>& starts, bool keep_going, WorkerPool& pool,
                                                     Progress& progress) {
  std::map<RobotId, CamerasOutcome> outcomes;
  for (const TierId& edge : plan.edges) {
    std::deque<Member> members;
    for (const PlannedRobot& robot : plan.robots) {
      if (robot.edge == edge && !robot.sensors.cameras.empty())
        members.push_back(
            {robot.id, CameraTask(robot, configuration_of(configuration, robot), keep_going, progress), {}});
    }
    drive(members, configuration, edge, starts, pool);
    std::vector<CamerasOutcome> finished =
        pool.map(members.size(), [&](std::size_t i) { return members[i].task.finish(); });
    for (std::size_t i = 0; i < members.size(); ++i) outcomes.emplace(members[i].robot, std::move(finished[i]));
  }
  return outcomes;
}

std::optional<std::string> note_on_sharing(const RunConfiguration& configuration, const RunPlan& plan,
                                           bool begins_with_maps) {
  if (configuration.server.share == tiers::Sharing::none) return std::nullopt;
  std::map<std::string, std::string> robots;  // that have cameras, by their edge
  std::size_t most_cameras = 0;
  for (const TierId& edge : plan.edges) {
    std::size_t cameras = 0;
    for (const PlannedRobot& robot : plan.robots) {
      if (robot.edge != edge || robot.sensors.cameras.empty()) continue;
      std::string& list = robots[edge.str()];
      list += (list.empty() ? "" : ", ") + robot.id.str();
      cameras += robot.sensors.cameras.size();
    }
    most_cameras = std::max(most_cameras, cameras);
  }
  const std::string option =
      configuration.server.share == tiers::Sharing::view ? "server.share=view" : "server.share=full";
  if (robots.empty()) return option + " has no effect: no robot of an edge maps with cameras";
  if (most_cameras < 2 && robots.size() == 1 && begins_with_maps) return std::nullopt;
  if (most_cameras < 2 && robots.size() == 1) return option + " has no effect: there is only one camera";
  if (robots.size() == 1) return std::nullopt;
  std::string list;
  for (const auto& [edge, there] : robots) list += (list.empty() ? "" : "; ") + edge + ": " + there;
  return option + (most_cameras < 2 && !begins_with_maps ? " has no effect" : " counts within each edge alone") +
         ": cameras of different edges share nothing while they drive (" + list +
         "); give their robots one edge, as in robots: [{id: ..., log: ..., edge: " + robots.begin()->first + "}]";
}

}  // namespace mapweave::runtime
