#include "shared_cameras.h"

#include "plan/team_options.h"
#include "results/file_shelf.h"

#include <mapweave/core/log.h>
#include <mapweave/tiers/visual_server.h>

#include <algorithm>
#include <deque>

namespace mapweave::runtime {
namespace {

// What a client's edge sends on to other edges, which take it a moment later.
struct PassedOn {
  SessionId from;
  std::string update;
};

// One camera's end of the wire; everything goes through the bytes that a network would carry.
class Link {
 public:
  Link(const CameraTask::Client& client, const RunConfiguration& configuration)
      : client_(client.client),
        report_(client.report),
        kept_(client.kept),
        agent_(client.place, configuration.uplink),
        place_(client.place),
        vocabulary_(configuration.visual.chosen_vocabulary.get().hash()) {}

  // Its maps, and where it is. passed_on: null where nobody else listens.
  // seconds: of data, since the first exchange of all.
  void publish(tiers::VisualServer& server, Stamp now, double seconds, std::vector<PassedOn>* passed_on) {
    second_ = static_cast<std::uint64_t>(std::max(0.0, seconds));
    const auto run = client_->run(place_);
    if (!run) return;
    if (!greeted_) {
      const std::string hello = encode(Hello{*run, vocabulary_});
      if (passed_on != nullptr) report_->passed_on_bytes += hello.size();
      agent_.reconnected(*client_, decode_receipts(encode(server.greet(decode_hello(hello, "hello"))), "welcome"));
      greeted_ = true;
    }
    for (const transport::Envelope& update : agent_.updates(*client_, now)) {
      tiers::VisualServer::Received received = server.receive(*run, update.bytes);
      if (passed_on != nullptr)
        for (std::string& stored : received.stored) {
          report_->passed_on_bytes += stored.size();
          passed_on->push_back({*run, std::move(stored)});
        }
      const std::string answer = encode(std::vector<Receipt>{received.receipt});
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

  // What the server keeps for it: the client has ended.
  void take_back(const tiers::VisualServer& server) {
    if (const auto run = client_->run(place_); run && greeted_) *kept_ = server.kept_for(*run);
  }

 private:
  void count() { count_sharing(*client_, agent_, second_, *report_); }

  visual::VisualClient* client_;
  CameraReport* report_;
  std::vector<tiers::KeptMap>* kept_;
  tiers::CameraAgent agent_;
  visual::ClientPlace place_;
  Hash vocabulary_;
  bool greeted_ = false, has_place_ = false;
  std::uint64_t second_ = 0;  // of data
};

struct Member {
  RobotId robot;
  CameraTask task;
  std::vector<Link> links;  // of the task's clients, which come one after the other
};

// An edge with cameras.
struct Edge {
  Edge(const TierId& name, const RunConfiguration& configuration, const RunPlan& plan, const std::vector<Map>& starts)
      : id(name),
        server(name, configuration.server, configuration.fusion, shared_rig_options(configuration, plan, name)) {
    server.refuse(plan.refused);
    server.begin_with(starts);
    server.use_shelf(std::make_shared<FileShelf>(folder_of_temporary_files()));
  }
  TierId id;
  std::deque<Member> members;
  tiers::VisualServer server;
  std::vector<PassedOn> passed_on;  // in the last moment
};

// What other edges sent in the last moment, in the order of their names.
void receive_from_others(std::deque<Edge>& edges) {
  for (Edge& here : edges)
    for (const Edge& there : edges) {
      if (&here == &there) continue;
      for (const PassedOn& one : there.passed_on) {
        here.server.greet({one.from, here.server.vocabulary()});
        here.server.receive(one.from, one.update);
      }
    }
  for (Edge& edge : edges) edge.passed_on.clear();
}

// seconds: of data, since the first moment of all.
struct Moment {
  Stamp stamp;
  double seconds;
};

void exchange(Edge& edge, const RunConfiguration& configuration, Moment now, bool others_listen, WorkerPool& pool) {
  for (Member& member : edge.members) {
    const auto clients = member.task.clients();
    while (member.links.size() < clients.size()) member.links.emplace_back(clients[member.links.size()], configuration);
    for (Link& link : member.links)
      link.publish(edge.server, now.stamp, now.seconds, others_listen ? &edge.passed_on : nullptr);
  }
  for (Member& member : edge.members)
    for (Link& link : member.links) link.ask(edge.server, pool);
  edge.server.advance(now.stamp, pool);
}

// All robots of edges that send each other what they receive, a moment at a time.
void drive(std::deque<Edge>& edges, const RunConfiguration& configuration, WorkerPool& pool) {
  const auto period_ns = static_cast<std::int64_t>(1e9 / configuration.server.share_rate_hz);
  const std::atomic<bool> give_up{false};
  std::vector<Member*> members;
  for (Edge& edge : edges)
    for (Member& member : edge.members) members.push_back(&member);
  std::optional<Stamp> begin;
  for (std::optional<Stamp> moment;;) {
    std::optional<Stamp> earliest;
    for (const Member* member : members)
      if (const auto next = member->task.next(); next && (!earliest || *next < *earliest)) earliest = next;
    if (!earliest) break;
    if (!moment || *moment < *earliest) moment = earliest;  // nothing happens in between
    if (!begin) begin = earliest;
    moment->ns += period_ns;
    pool.for_each(members.size(), [&](std::size_t i) { members[i]->task.advance(moment, give_up); });
    receive_from_others(edges);
    for (Edge& edge : edges)
      exchange(edge, configuration, {*moment, seconds_between(*begin, *moment)}, edges.size() > 1, pool);
  }
  for (Edge& edge : edges)
    for (Member& member : edge.members)
      for (Link& link : member.links) link.take_back(edge.server);
}

// What became of them, and of what their edge kept for them.
void finish(Edge& edge, std::map<RobotId, CamerasOutcome>& outcomes, WorkerPool& pool) {
  std::vector<CamerasOutcome> finished =
      pool.map(edge.members.size(), [&](std::size_t i) { return edge.members[i].task.finish(); });
  if (const auto trouble = edge.server.keeping_trouble()) {
    log(LogLevel::warning, *trouble);
    finished.front().doubts.push_back(*trouble);
  }
  for (std::size_t i = 0; i < edge.members.size(); ++i) outcomes.emplace(edge.members[i].robot, std::move(finished[i]));
}

}  // namespace

void count_sharing(const visual::VisualClient& client, const tiers::CameraAgent& agent, std::uint64_t second,
                   CameraReport& report) {
  if (agent.sent_bytes() != report.sent_bytes || agent.received_bytes() != report.received_bytes) {
    auto& traffic = report.traffic;
    if (traffic.empty() || traffic.back().second != second) traffic.push_back({second, 0, 0});
    traffic.back().sent_bytes += agent.sent_bytes() - report.sent_bytes;
    traffic.back().received_bytes += agent.received_bytes() - report.received_bytes;
  }
  report.sent_bytes = agent.sent_bytes();
  report.received_bytes = agent.received_bytes();
  report.shared_keyframes = std::max(report.shared_keyframes, std::uint64_t{client.shared_keyframes().size()});
  report.dropped_shared = client.dropped_shared();
  report.found_by_shared = client.found_by_shared();
  report.borrowed = std::max(report.borrowed, std::uint64_t{client.borrowed_seen()});
}

std::map<RobotId, CamerasOutcome> map_shared_cameras(const RunConfiguration& configuration, const RunPlan& plan,
                                                     const std::vector<Map>& starts, bool keep_going, WorkerPool& pool,
                                                     Progress& progress) {
  std::map<RobotId, CamerasOutcome> outcomes;
  std::deque<Edge> edges;  // that send each other what they receive
  for (const TierId& id : plan.edges) {
    if (!configuration.server.across_edges) edges.clear();
    Edge& edge = edges.emplace_back(id, configuration, plan, starts);
    for (const PlannedRobot& robot : plan.robots)
      if (robot.edge == id && !robot.sensors.cameras.empty())
        edge.members.push_back(
            {robot.id, CameraTask(robot, configuration_of(configuration, robot), keep_going, progress), {}});
    if (edge.members.empty()) {
      edges.pop_back();
      continue;
    }
    if (configuration.server.across_edges) continue;
    drive(edges, configuration, pool);
    finish(edge, outcomes, pool);
  }
  if (configuration.server.across_edges) {
    drive(edges, configuration, pool);
    for (Edge& edge : edges) finish(edge, outcomes, pool);
  }
  return outcomes;
}

std::optional<std::string> note_on_sharing(const RunConfiguration& configuration, const RunPlan& plan,
                                           bool shares_alone) {
  if (configuration.server.share == tiers::Sharing::none) return std::nullopt;
  std::map<std::string, std::string> robots;  // that have cameras, by their edge
  std::size_t most_cameras = 0, all_cameras = 0;
  for (const TierId& edge : plan.edges) {
    std::size_t cameras = 0;
    for (const PlannedRobot& robot : plan.robots) {
      if (robot.edge != edge || robot.sensors.cameras.empty()) continue;
      std::string& list = robots[edge.str()];
      list += (list.empty() ? "" : ", ") + robot.id.str();
      cameras += robot.sensors.cameras.size();
    }
    most_cameras = std::max(most_cameras, cameras);
    all_cameras += cameras;
  }
  const tiers::Sharing share = configuration.server.share;
  const std::string option = std::string("server.share=") + (share == tiers::Sharing::view   ? "view"
                                                             : share == tiers::Sharing::full ? "full"
                                                                                             : "global");
  if (robots.empty()) return option + " has no effect: no robot of an edge maps with cameras";
  if (all_cameras < 2 && !shares_alone)
    return option + " has no effect: there is only one camera, and it had room for all that it mapped";
  if (robots.size() == 1 || configuration.server.across_edges) return std::nullopt;
  std::string list;
  for (const auto& [edge, there] : robots) list += (list.empty() ? "" : "; ") + edge + ": " + there;
  return option + (most_cameras < 2 && !shares_alone ? " has no effect" : " counts within each edge alone") +
         ": cameras of different edges share nothing while they drive (" + list + "), since server.across_edges=false";
}

}  // namespace mapweave::runtime
