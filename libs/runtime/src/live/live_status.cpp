#include <mapweave/runtime/live_status.h>

#include <mapweave/core/format.h>
#include <mapweave/runtime/manifest.h>
#include <mapweave/runtime/metrics.h>

#include <nlohmann/json.hpp>

#include <optional>
#include <set>

namespace mapweave::runtime {
namespace {

using Json = nlohmann::ordered_json;

Json tier(const char* role, const std::string& name, const char* state, bool is_done) {
  return {{"role", role},
          {"name", name},
          {"state", state},
          {"is_done", is_done},
          {"counts", Json::object()},
          {"joint", Json::array()},
          {"links", Json::array()},
          {"findings", Json::array()}};
}

Json joint_json(const std::vector<std::vector<MapId>>& joint) {
  Json groups = Json::array();
  for (const std::vector<MapId>& members : joint) {
    Json names = Json::array();
    for (const MapId& member : members) names.push_back(member.str());
    groups.push_back(std::move(names));
  }
  return groups;
}

// Seconds by robot.
Json seconds_json(const std::map<RobotId, Stamp>& stamps) {
  Json seconds = Json::object();
  for (const auto& [robot, stamp] : stamps) seconds[robot.str()] = stamp.seconds();
  return seconds;
}

Json link(const char* role, const std::string& name, bool is_on_wire, bool is_needed,
          const std::optional<double>& silent_s, Json counts) {
  return {{"role", role},
          {"name", name},
          {"is_on_wire", is_on_wire},
          {"is_needed", is_needed},
          {"silent_seconds", silent_s ? Json(*silent_s) : Json()},
          {"counts", std::move(counts)}};
}

// Of the link to the other end, where it was measured.
Json measured(const std::optional<double>& bytes_per_s) {
  return bytes_per_s ? Json{{"bytes_per_second", *bytes_per_s}} : Json::object();
}

// Where it follows one.
void add_plan(Json& tier, std::uint64_t plan) {
  if (plan > 0) tier["counts"]["plan"] = plan;
}

void find(Json& tier, const char* level, const std::string& what, const std::string& remedy) {
  tier["findings"].push_back({{"level", level}, {"what", what}, {"remedy", remedy}});
}

// Of the link that was added last.
void add_wire(Json& tier, const transport::Channel::Health& wire, const StatusTerms& terms) {
  Json& link = tier["links"].back();
  Json& counts = link["counts"];
  counts["wire_refused"] = wire.refused;
  counts["wire_missed"] = wire.missed;
  counts["wire_sent_again"] = wire.unconfirmed;
  counts["wire_full_seconds"] = wire.full_s.value_or(0.0);
  const std::string role = link["role"], name = role == "cloud" ? "" : " " + link["name"].get<std::string>(),
                    to = "its wire to " + (role == "cloud" ? "the cloud" : role + name) + ": ";
  if (wire.full_s.value_or(0.0) >= terms.patience_s)
    find(tier, "warning", to + format("the broker has had no room for %.0f s", *wire.full_s),
         "look whether " + role + name + " runs, and whether the broker's disk has room");
  else if (!wire.trouble.empty())
    find(tier, "warning", to + wire.trouble, "it tries again by itself; look at the broker where this stays");
  if (wire.refused > 0)
    find(tier, "warning", to + std::to_string(wire.refused) + " parts that came are no messages",
         "look who else writes into the broker's streams of this deployment; give programs keys (serve keys)");
}

std::string start_of(const Json& link) {
  const std::string role = link["role"], name = role == "cloud" ? "" : " --name " + link["name"].get<std::string>();
  return "look whether mapweave serve " + role + name + " runs, and whether it reaches the broker";
}

// Who is needed and says nothing; an error where nobody says anything.
void find_missing(Json& tier, const StatusTerms& terms) {
  std::size_t needed = 0, missing = 0;
  for (const Json& link : tier["links"]) {
    if (!link["is_needed"]) continue;
    ++needed;
    const bool came = link["silent_seconds"].is_number();
    const double silent_s = came ? link["silent_seconds"].get<double>() : terms.up_s;
    if (silent_s < terms.patience_s) continue;
    ++missing;
    const std::string who =
        link["role"] == "cloud" ? "the cloud" : link["role"].get<std::string>() + " " + link["name"].get<std::string>();
    find(tier, "warning", who + (came ? format(" has said nothing for %.0f s", silent_s) : " never came"),
         start_of(link));
  }
  if (needed > 0 && missing == needed)
    find(tier, "error", format("nobody that is needed has said anything for %.0f s", terms.patience_s),
         "look whether the broker of live.broker runs, and can be reached from here");
}

void find_refused(Json& tier, std::uint64_t refused, std::uint64_t unreadable) {
  if (refused > 0)
    find(tier, "warning", "refused " + std::to_string(refused) + " times who wanted to take part",
         "its messages say why: an unknown name, a name that is here, or another configuration or version");
  if (unreadable > 0)
    find(tier, "warning", std::to_string(unreadable) + " messages could not be read",
         "give all programs the same version; its messages name the first one");
}

// Of a camera map server, and what is wrong with it.
void add_cameras(Json& tier, const ServerCounts& server) {
  ClientCounts all;
  std::set<ClientId> cameras;
  for (const ClientCounts& client : server.clients) {
    add(all, client);
    if (client.session != SessionId{}) cameras.insert(client.session.client);
  }
  Json& counts = tier["counts"];
  counts["cameras"] = cameras.size();
  counts["camera_received_bytes"] = all.received_bytes;
  counts["camera_sent_bytes"] = all.sent_bytes;
  counts["camera_updates"] = all.updates;
  counts["camera_views"] = all.views;
  counts["camera_shares"] = all.shares;
  counts["camera_places"] = all.places;
  counts["camera_refused"] = all.refused;
  counts["camera_merges"] = server.merges;
  if (!server.trouble.empty())
    find(tier, "error", "its camera map server: " + server.trouble,
         "it tries again; cameras map on without it meanwhile");
  for (const std::string& note : server.notes) find(tier, "warning", note, "the final map is made without it");
  if (all.refused > 0)
    find(tier, "warning", "its camera map server refused " + std::to_string(all.refused) + " messages of cameras",
         "the robots' messages say why: another vocabulary (visual.vocabulary), another robot's camera, or too many");
}

void add_sharing(Json& tier, const LiveRobotCounts::Sharing& sharing, const std::string& edge, bool is_driving) {
  Json& counts = tier["counts"];
  counts["cameras"] = sharing.cameras;
  counts["cameras_on_wire"] = sharing.on_wire;
  counts["camera_sent_bytes"] = sharing.sent_bytes;
  counts["camera_received_bytes"] = sharing.received_bytes;
  counts["shared_keyframes"] = sharing.shared_keyframes;
  counts["borrowed_landmarks"] = sharing.borrowed;
  if (!sharing.refusal.empty())
    find(tier, "warning", "the camera map server of edge " + edge + " refuses: " + sharing.refusal,
         "the message says what is wrong; the camera maps alone");
  else if (is_driving && sharing.on_wire < sharing.cameras)
    find(tier, "warning",
         std::to_string(sharing.cameras - sharing.on_wire) + " of its " + std::to_string(sharing.cameras) +
             " cameras have no answer of edge " + edge + "'s camera map server",
         "they map alone, and share again once it answers");
}

void find_trouble(Json& tier, const std::string& trouble, const std::set<std::string>& of_wires) {
  for (const std::string& wire : of_wires)
    find(tier, "warning", "a wire on which nobody has come: " + wire,
         "it tries again by itself; look at the broker where this stays");
  if (!trouble.empty()) find(tier, "error", trouble, "start it again once the cause is gone: it goes on where it was");
}

}  // namespace

Json tier_status(const LiveCloudCounts& counts, const StatusTerms& terms) {
  Json status = tier("cloud", "cloud",
                     counts.is_done      ? "done"
                     : counts.is_sealing ? "merging all"
                                         : "collecting",
                     counts.is_done);
  status["counts"] = {{"previews", counts.previews},
                      {"preview_maps", counts.maps},
                      {"refused", counts.refused},
                      {"unreadable", counts.unreadable},
                      {"repeated", counts.again}};
  add_plan(status, counts.plan);
  status["is_sealing"] = counts.is_sealing;
  status["joint"] = joint_json(counts.joint);
  status["newest_scan_s"] = seconds_json(counts.newest_scans);
  status["apart"] = counts.apart;
  for (const LiveCloudCounts::EdgeCounts& edge : counts.edges) {
    status["links"].push_back(link("edge", edge.id.str(), edge.is_on_wire, edge.is_needed && !edge.has_fused,
                                   edge.silent_s,
                                   {{"taken", edge.taken}, {"stored", edge.stored}, {"begun", edge.runs}}));
    add_wire(status, edge.wire, terms);
  }
  find_trouble(status, counts.trouble, counts.wire_troubles);
  find_missing(status, terms);
  find_refused(status, counts.refused, counts.unreadable);
  return status;
}

Json tier_status(const TierId& edge, const LiveEdgeCounts& counts, const StatusTerms& terms) {
  Json status = tier("edge", edge.str(),
                     counts.is_done    ? "done"
                     : counts.is_fused ? "merged"
                                       : "mapping",
                     counts.is_done);
  status["counts"] = {{"previews", counts.previews}, {"waiting_bytes", counts.waiting_bytes},
                      {"refused", counts.refused},   {"unreadable", counts.unreadable},
                      {"repeated", counts.again},    {"mapping_seconds", counts.mapping_s}};
  add_plan(status, counts.plan);
  status["joint"] = joint_json(counts.joint);
  status["newest_scan_s"] = seconds_json(counts.newest_scans);
  status["ended"] = Json::array();
  for (const LiveEdgeCounts::RobotCounts& robot : counts.robots)
    if (robot.has_ended) status["ended"].push_back(robot.id.str());
  for (const LiveEdgeCounts::RobotCounts& robot : counts.robots) {
    status["links"].push_back(link("robot", robot.id.str(), robot.is_on_wire, robot.is_member && !robot.has_said_all,
                                   robot.silent_s,
                                   {{"taken", robot.taken},
                                    {"stored", robot.stored},
                                    {"mapped", robot.mapped},
                                    {"scans", robot.scans},
                                    {"lost_scans", robot.lost_scans},
                                    {"queue_bytes", robot.queue_bytes},
                                    {"begun", robot.begun}}));
    add_wire(status, robot.wire, terms);
  }
  status["links"].push_back(link("cloud", "cloud", counts.is_cloud_on_wire, !counts.is_done, counts.cloud_silent_s,
                                 measured(counts.bytes_per_s)));
  add_wire(status, counts.cloud_wire, terms);
  find_trouble(status, counts.trouble, counts.wire_troubles);
  if (counts.cameras) add_cameras(status, *counts.cameras);
  find_missing(status, terms);
  find_refused(status, counts.refused, counts.unreadable);
  for (const LiveEdgeCounts::RobotCounts& robot : counts.robots)
    if (robot.begun_soon >= 2)
      find(status, "warning",
           "robot " + robot.id.str() + " has begun " + std::to_string(robot.begun) + " times, the last ones in a row",
           "look whether two programs run with its name, and whether its network is cut again and again");
  for (const LiveEdgeCounts::RobotCounts& robot : counts.robots)
    if (robot.lost_scans > 0)
      find(status, "warning",
           "robot " + robot.id.str() + " had no room for " + std::to_string(robot.lost_scans) + " scans",
           "a larger live.robot_buffer_kb keeps more while its edge is away");
  return status;
}

Json tier_status(const RobotId& robot, const TierId& its_edge, const LiveRobotCounts& counts,
                 const StatusTerms& terms) {
  const bool is_done = counts.is_read && counts.confirmed >= counts.messages;
  Json status = tier("robot", robot.str(), is_done ? "done" : counts.is_read ? "sending the rest" : "driving", is_done);
  status["counts"] = {{"records", counts.records},
                      {"recorded_seconds", counts.recorded_s},
                      {"scans", counts.scans},
                      {"lost_scans", counts.lost_scans},
                      {"messages", counts.messages},
                      {"confirmed", counts.confirmed},
                      {"waiting_bytes", counts.waiting_bytes},
                      {"sent_bytes", counts.sent_bytes},
                      {"moves", counts.moves}};
  if (its_edge.empty())
    find(status, is_done ? "warning" : "error", "there is no edge for it",
         "look whether mapweave serve coordinator runs; else raise an edge's capacity, or start another edge");
  else {
    status["links"].push_back(
        link("edge", its_edge.str(), counts.is_edge_on_wire, !is_done, counts.silent_s, measured(counts.bytes_per_s)));
    add_wire(status, counts.wire, terms);
  }
  if (!counts.refusal.empty())
    find(status, "error", "edge " + its_edge.str() + " refuses: " + counts.refusal,
         "the message says what is wrong; the robot asks again and again");
  if (counts.trouble)
    find(status, "error", std::string("its log was not read to its end: ") + counts.trouble->what(),
         "its edge maps what was read; mend the log, and run the deployment again");
  if (counts.sharing) add_sharing(status, *counts.sharing, its_edge.str(), !counts.is_read);
  find_missing(status, terms);
  if (counts.lost_scans > 0)
    find(status, "warning", "there was no room for " + std::to_string(counts.lost_scans) + " scans",
         "a larger live.robot_buffer_kb keeps more while its edge is away");
  return status;
}

namespace {

const char* state_of(const LivePlan& plan) {
  if (plan.number == 0) return "waiting for robots";
  return plan.is_done ? "done" : plan.is_final ? "all robots have ended" : "planning";
}

void find_unplaced(Json& status, const LiveCoordinatorCounts& counts, const StatusTerms& terms) {
  for (const LiveCoordinatorCounts::RobotCounts& robot : counts.robots) {
    const std::string who = "robot " + robot.id.str();
    if (robot.has_come && robot.edge.empty())
      find(status, "error", "no edge has room for " + who, "raise an edge's capacity, or start another edge");
    else if (robot.has_come && robot.at != robot.edge && counts.plan_age_s >= terms.patience_s)
      find(status, "warning", who + " has not gone to edge " + robot.edge.str() + " yet",
           "look whether mapweave serve robot --name " + robot.id.str() + " runs, and whether it reaches the broker");
  }
  if (counts.unreadable > 0)
    find(status, "warning", std::to_string(counts.unreadable) + " words of programs could not be read",
         "give all programs the same version; its messages name the first one");
}

}  // namespace

Json tier_status(const LiveCoordinatorCounts& counts, const StatusTerms& terms) {
  const bool is_done = counts.plan.is_done;
  Json status = tier("coordinator", "coordinator", state_of(counts.plan), is_done);
  status["counts"] = {{"decisions", counts.decisions},
                      {"moves", counts.moves},
                      {"unreadable", counts.unreadable},
                      {"expected_seconds", counts.expected_s}};
  if (counts.actual_s) status["counts"]["actual_seconds"] = *counts.actual_s;
  add_plan(status, counts.plan.number);
  status["groups"] = Json::object();
  for (const LiveCoordinatorCounts::EdgeCounts& edge : counts.edges) {
    Json& group = status["groups"][edge.id.str()] = Json::array();
    for (const RobotId& robot : edge.robots) group.push_back(robot.str());
    Json one = link("edge", edge.id.str(), edge.is_there, !is_done && !edge.robots.empty(), edge.silent_s,
                    {{"speed", edge.speed}, {"bytes_per_second", edge.bytes_per_s}});
    one["speed_is"] = edge.speed_is;
    one["bytes_per_second_is"] = edge.bytes_are;
    status["links"].push_back(std::move(one));
  }
  for (const LiveCoordinatorCounts::RobotCounts& robot : counts.robots) {
    Json one = link("robot", robot.id.str(), robot.has_come, !robot.has_ended, robot.silent_s,
                    {{"scans", robot.scans}, {"queue_bytes", robot.queue_bytes}});
    one["edge"] = robot.edge.str();
    status["links"].push_back(std::move(one));
  }
  status["links"].push_back(
      link("cloud", "cloud", counts.cloud_silent_s.has_value(), !is_done, counts.cloud_silent_s, Json::object()));
  status["last"] = counts.last;
  find_missing(status, terms);
  find_unplaced(status, counts, terms);
  return status;
}

Json program_status(const std::string& program, const std::string& name, std::vector<Json> tiers,
                    const StatusTerms& terms) {
  Json problems = Json::array();
  for (const Json& tier : tiers)
    for (const Json& finding : tier["findings"])
      if (finding["level"] == "error")
        problems.push_back(tier["role"].get<std::string>() + " " + tier["name"].get<std::string>() + ": " +
                           finding["what"].get<std::string>());
  return {{"program", program},
          {"name", name},
          {"version", program_version()},
          {"up_seconds", terms.up_s},
          {"is_healthy", problems.empty()},
          {"problems", problems},
          {"process",
           {{"cpu_seconds", process_cpu_seconds()},
            {"resident_bytes", rss_bytes()},
            {"peak_resident_bytes", peak_rss_bytes()}}},
          {"tiers", std::move(tiers)}};
}

}  // namespace mapweave::runtime
