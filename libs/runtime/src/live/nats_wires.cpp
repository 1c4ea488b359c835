#include <mapweave/core/error.h>
#include <mapweave/core/log.h>
#include <mapweave/runtime/deployment_keys.h>
#include <mapweave/runtime/nats_wires.h>
#include <mapweave/transport/nats_channel.h>
#include <mapweave/transport/nats_stream.h>

#include <algorithm>
#include <sstream>

namespace mapweave::runtime {
namespace {

// A broker sets aside what its streams may hold, so that many edges find room in small stores. In bytes.
constexpr std::uint64_t kCameraStream = std::uint64_t{128} << 20, kMapStream = 4 * kLongestOfMaps,
                        kLeastRobotStream = std::uint64_t{256} << 20, kMostRobotStream = std::uint64_t{1} << 30,
                        kWorkStream = std::uint64_t{1} << 30, kBoards = std::uint64_t{512} << 20;
constexpr std::size_t kRobotInFlight = std::size_t{16} << 20;
constexpr int kCameraClasses = 2;  // see with_cameras()

// Names of streams have no dots.
std::string stream_name(const std::string& name) {
  std::string made = name;
  std::replace(made.begin(), made.end(), '.', '_');
  return made;
}

bool is_on_this_machine(const std::string& urls) {
  std::istringstream all(urls);
  for (std::string url; std::getline(all, url, ',');) {
    const std::size_t scheme = url.find("://");
    std::string host = scheme == std::string::npos ? url : url.substr(scheme + 3);
    host = host.substr(host.find('@') == std::string::npos ? 0 : host.find('@') + 1);
    if (host.rfind("127.", 0) != 0 && host.rfind("localhost", 0) != 0 && host.rfind("[::1]", 0) != 0) return false;
  }
  return true;
}

// All of a wire is in one class, so that it comes in the order in which it was said. Who accepts makes the streams, and
// asks at them for the first message before anybody says it; else it would have to look whether they are there by now.
transport::NatsChannelOptions options_of(const std::string& wire, const std::string& peer,
                                         transport::NatsChannelSide side) {
  transport::NatsChannelOptions options;
  options.peer = peer;
  options.side = side;
  options.limits.bytes = kRobotInFlight;
  options.out = {wire + "_up", {}};
  options.in = {wire + "_down", {}};
  options.makes_streams = side == transport::NatsChannelSide::accepts;
  if (side == transport::NatsChannelSide::accepts) std::swap(options.out, options.in);
  return options;
}

// The wire of an edge with a broker of its own to the cloud's: each end makes the streams of what it says at its own
// broker, and reads the other's.
transport::NatsChannelOptions across_brokers(transport::NatsChannelOptions options, const std::string& domain) {
  if (domain.empty()) return options;
  options.in.domain = options.side == transport::NatsChannelSide::opens ? kHubDomain : domain;
  options.link_end = transport::LinkEnd::receiver;
  options.makes_streams = false;
  return options;
}

// Of the wires of an edge's robots, all of which may have as much in flight as they can.
std::uint64_t robot_stream(const RunConfiguration& configuration) {
  return std::clamp<std::uint64_t>(2 * kRobotInFlight * configuration.robots.size(), kLeastRobotStream,
                                   kMostRobotStream);
}

transport::NatsChannelOptions in_streams_of(std::uint64_t bytes, transport::NatsChannelOptions options) {
  options.out.stream_bytes = options.in.stream_bytes = bytes;
  return options;
}

transport::NatsChannelOptions with_cameras(transport::NatsChannelOptions options, std::size_t queue_bytes) {
  options.priorities = urgent_of_cameras();
  options.limits.bytes = queue_bytes;
  return in_streams_of(kCameraStream, std::move(options));
}

transport::NatsChannelOptions with_maps(transport::NatsChannelOptions options) {
  options.limits.bytes = kLongestOfMaps;
  options.received.message_bytes = kLongestOfMaps;
  return options;
}

// What either end of a wire does with the broker. peer: of one wire, or "*" for all that a tier accepts. in_domain: of
// the other end's broker, where each end has one. number: of the class of messages.
void allow(transport::BrokerUser& user, const std::string& wire, const std::string& peer,
           transport::NatsChannelSide side, const std::string& in_domain = {}, int number = 0) {
  const bool accepts = side == transport::NatsChannelSide::accepts;
  const std::string in_api = in_domain.empty() ? "$JS.API." : "$JS." + in_domain + ".API.";
  const std::string class_number = std::to_string(number), up = "_up_" + class_number, down = "_down_" + class_number;
  const std::string out = wire + (accepts ? down : up), in = wire + (accepts ? up : down);
  const auto may = [&](const std::string& subject) { user.may_publish.push_back(subject); };
  may("mw." + wire + (accepts ? "_down." : "_up.") + class_number + "." + peer);
  may("$JS.API.CONSUMER.INFO." + out + "." + peer);
  for (const char* what : {"INFO.", "DURABLE.CREATE.", "DELETE.", "MSG.NEXT."})
    may(in_api + "CONSUMER." + what + in + "." + peer);
  may("$JS.ACK." + in + "." + peer + ".>");
  for (const std::string& stream : {out, in}) {
    const std::string api = stream == in ? in_api : "$JS.API.";
    may(api + "STREAM.INFO." + stream);
    may(api + "STREAM.PURGE." + stream);
    if (stream == in) may(api + "STREAM.DELETE." + stream);
    if (in_domain.empty() ? !accepts : stream == in) continue;
    may(api + "STREAM.CREATE." + stream);
    may(api + "STREAM.UPDATE." + stream);
  }
}

constexpr char kBoard[] = "status", kPlans[] = "plan", kWorkers[] = "workers", kWork[] = "work";

transport::BrokerUser new_user(const std::string& name) {
  const std::string inbox = inbox_of(name) + ".>";
  return {name, "", {"$JS.API.INFO", inbox, transport::NatsBoard::subject_of(kBoard, name)}, {inbox}};
}

void allow_board(transport::BrokerUser& user, const char* board, std::initializer_list<const char*> what) {
  for (const char* one : what) user.may_publish.push_back(std::string("$JS.API.STREAM.") + one + "." + board);
}

Connect connect(const std::shared_ptr<transport::NatsConnection>& connection, transport::NatsChannelOptions options) {
  return [connection, options = std::move(options)]() -> std::shared_ptr<transport::Channel> {
    return std::make_shared<transport::NatsChannel>(connection, options);
  };
}

std::string of_edge(const TierId& edge) { return "edge_" + stream_name(edge.str()); }
std::string of_cloud(const TierId& edge) { return "cloud_" + stream_name(edge.str()); }
std::string of_cameras(const TierId& edge) { return "cameras_" + stream_name(edge.str()); }

// Of one camera's wire; of no two robots the same, since a robot's name ends at the last dot.
std::string camera_peer(const RobotId& robot, int number) { return robot.str() + "." + std::to_string(number); }

// Where cameras share while they drive: nobody knows beforehand how many a robot has.
void allow_cameras(transport::BrokerUser& robot, const PlannedRobot& planned) {
  for (int number = 0; number < static_cast<int>(kMostSharingCameras); ++number)
    for (int one = 0; one < kCameraClasses; ++one)
      allow(robot, of_cameras(planned.edge), transport::nats_token(camera_peer(planned.id, number)),
            transport::NatsChannelSide::opens, {}, one);
}

// Where a coordinator may give any robot to any edge: who follows its plan, and what it receives of maps.
void allow_coordinated(std::vector<transport::BrokerUser>& users, const RunPlan& plan) {
  using Side = transport::NatsChannelSide;
  const auto user = [&](const std::string& name) -> transport::BrokerUser& {
    return *std::find_if(users.begin(), users.end(), [&](const auto& one) { return one.name == name; });
  };
  for (const PlannedRobot& robot : plan.robots) {
    transport::BrokerUser& of_robot = user("robot-" + robot.id.str());
    for (const TierId& edge : plan.edges)
      if (edge != robot.edge) allow(of_robot, of_edge(edge), transport::nats_token(robot.id.str()), Side::opens);
    allow_board(of_robot, kPlans, {"INFO", "MSG.GET"});
  }
  for (const TierId& edge : plan.edges) {
    transport::BrokerUser& of_this = user("edge-" + edge.str());
    of_this.may_publish.push_back(transport::NatsBoard::subject_of(kBoard, maps_word_of(edge)));
    allow_board(of_this, kPlans, {"INFO", "MSG.GET"});
  }
  allow_board(user("cloud"), kPlans, {"INFO", "MSG.GET"});
  transport::BrokerUser coordinator = new_user("coordinator");
  coordinator.may_publish.push_back(transport::NatsBoard::subject_of(kPlans, "coordinator"));
  allow_board(coordinator, kBoard, {"INFO", "CREATE", "MSG.GET"});
  allow_board(coordinator, kPlans, {"INFO", "CREATE", "MSG.GET"});
  users.push_back(std::move(coordinator));
}

// What the own broker of an edge, a leaf node, says to live.broker and gets from there: the edge's wire to the cloud,
// and answers to the cloud and the doctor. Whoever takes it over speaks for this edge alone.
transport::BrokerUser leaf_user(const TierId& edge, const std::string& domain) {
  transport::BrokerUser at_hub, leaf{leaf_user_of(edge), "", {}, {}};
  const std::string wire = of_cloud(edge), name = transport::nats_token(edge.str()), inbox = ".>";
  allow(at_hub, wire, name, transport::NatsChannelSide::opens, kHubDomain);
  for (const std::string& subject : at_hub.may_publish)
    for (const std::string& start : {std::string("$JS.") + kHubDomain + ".API.", std::string("$JS.ACK.")})
      if (subject.rfind(start, 0) == 0) leaf.may_publish.push_back(subject);
  for (const char* user : {"cloud", "doctor"}) leaf.may_publish.push_back(inbox_of(user) + inbox);
  leaf.may_receive = {"$JS." + domain + ".API.>", "$JS.ACK." + wire + "_up_0." + name + ".>",
                      inbox_of("edge-" + edge.str()) + inbox};
  return leaf;
}

}  // namespace

std::string leaf_user_of(const TierId& edge) { return "leaf-" + edge.str(); }

std::string maps_word_of(const TierId& edge) { return "maps-" + edge.str(); }

std::string domain_of(const EdgeEntry& edge) { return edge.broker.empty() ? "" : "edge_" + stream_name(edge.id); }

std::uint64_t store_bytes(const RunConfiguration& configuration, const RunPlan& plan) {
  const std::uint64_t cameras = shares_cameras(configuration) ? 2 * kCameraClasses * kCameraStream : 0;
  return plan.edges.size() * (2 * robot_stream(configuration) + 2 * kMapStream + cameras) + 2 * kWorkStream + kBoards;
}

std::vector<transport::BrokerUser> users_of(const RunConfiguration& configuration, const RunPlan& plan,
                                            const std::optional<TierId>& at_broker_of) {
  using Side = transport::NatsChannelSide;
  const auto is_here = [&](const TierId& edge) {
    return edge_entry(configuration, edge).broker.empty() ? !at_broker_of : at_broker_of == edge;
  };
  const bool shares = shares_cameras(configuration);
  std::vector<transport::BrokerUser> users;
  transport::BrokerUser cloud = new_user("cloud"), doctor = new_user("doctor");
  for (const TierId& edge : plan.edges) {
    const std::string domain = domain_of(edge_entry(configuration, edge));
    allow(cloud, of_cloud(edge), "*", Side::accepts, domain);
    if (!domain.empty() && !at_broker_of) users.push_back(leaf_user(edge, domain));
    for (const char* what : {"INFO", "MSG.GET"})
      if (!domain.empty()) doctor.may_publish.push_back("$JS." + domain + ".API.STREAM." + what + "." + kBoard);
    if (!is_here(edge)) continue;
    transport::BrokerUser& user = users.emplace_back(new_user("edge-" + edge.str()));
    allow(user, of_edge(edge), "*", Side::accepts);
    for (int one = 0; shares && one < kCameraClasses; ++one) allow(user, of_cameras(edge), "*", Side::accepts, {}, one);
    allow(user, of_cloud(edge), transport::nats_token(edge.str()), Side::opens, domain.empty() ? "" : kHubDomain);
    allow_board(user, kBoard, {"INFO", "CREATE"});
  }
  const bool is_coordinated = configuration.coordinator.method.has_value();
  for (const PlannedRobot& robot : plan.robots) {
    if (!(robot.edge.empty() ? is_coordinated : is_here(robot.edge))) continue;
    transport::BrokerUser& user = users.emplace_back(new_user("robot-" + robot.id.str()));
    if (robot.edge.empty()) continue;
    allow(user, of_edge(robot.edge), transport::nats_token(robot.id.str()), Side::opens);
    if (shares) allow_cameras(user, robot);
  }
  if (!at_broker_of) {
    allow_board(cloud, kBoard, {"INFO", "CREATE"});
    users.push_back(std::move(cloud));
    // All workers are one user, who may map for all runs.
    for (const auto& [name, side] : {std::make_pair("worker", Side::accepts), std::make_pair("run", Side::opens)}) {
      transport::BrokerUser& user = users.emplace_back(new_user(name));
      allow(user, kWork, "*", side);
      allow_board(user, kWorkers, {"INFO", "CREATE", "MSG.GET"});
      user.may_publish.push_back("mw." + std::string(kWorkers) + ".*");
    }
  }
  allow_board(doctor, kBoard, {"INFO", "CREATE", "MSG.GET"});
  users.push_back(std::move(doctor));
  if (is_coordinated) allow_coordinated(users, plan);
  return users;
}

NatsWires::NatsWires(const RunConfiguration& configuration, const LiveOptions& live, std::chrono::milliseconds patience)
    : camera_queue_bytes_(static_cast<std::size_t>(live.camera_map_server.queue_kb) << 10),
      robot_stream_(robot_stream(configuration)),
      edges_(configuration.edges) {
  transport::NatsOptions options;
  const std::string broker = live.broker_url();
  if (live.is_over_ros())
    throw Error(ErrorCode::kBadInput, "only nodes of ROS talk over ROS", "live.broker",
                "start the programs as nodes (mapweave_ros), or name a NATS server");
  options.url = broker;
  if (!live.keys.empty()) {
    const ProgramKeys keys = read_program_keys(live.keys);
    options.user = keys.user;
    options.password = keys.password;
    options.ca_text = keys.authority;
    options.inbox = inbox_of(keys.user);
  } else if (!is_on_this_machine(broker)) {
    if (!live.unprotected)
      throw Error(ErrorCode::kBadInput, "the broker is on another machine, and this program has no keys", broker,
                  "have them made (mapweave serve keys) and name this program's in live.keys; or set "
                  "live.unprotected: true where you trust everyone who reaches the broker");
    log(LogLevel::warning, broker +
                               ": not protected (live.unprotected): whoever reaches this broker can read all maps, "
                               "and send others");
  }
  connection_ = std::make_shared<transport::NatsConnection>(options);
  connection_->wait_until_connected(patience);
  connection_->expect_jet_stream(patience);
}

Connect NatsWires::from_robot(const RobotId& robot, const TierId& edge) const {
  return of_robot(robot, edge, transport::NatsChannelSide::opens);
}
Connect NatsWires::at_edge(const RobotId& robot, const TierId& edge) const {
  return of_robot(robot, edge, transport::NatsChannelSide::accepts);
}
Connect NatsWires::of_robot(const RobotId& robot, const TierId& edge, transport::NatsChannelSide side) const {
  return connect(connection_, in_streams_of(robot_stream_, options_of(of_edge(edge), robot.str(), side)));
}
Connect NatsWires::from_camera(const RobotId& robot, int number, const TierId& edge) const {
  return of_camera(robot, number, edge, transport::NatsChannelSide::opens);
}
Connect NatsWires::at_camera_map_server(const RobotId& robot, int number, const TierId& edge) const {
  return of_camera(robot, number, edge, transport::NatsChannelSide::accepts);
}
Connect NatsWires::of_camera(const RobotId& robot, int number, const TierId& edge,
                             transport::NatsChannelSide side) const {
  return connect(connection_,
                 with_cameras(options_of(of_cameras(edge), camera_peer(robot, number), side), camera_queue_bytes_));
}
Connect NatsWires::from_edge(const TierId& edge) const {
  return between_tiers(edge, transport::NatsChannelSide::opens);
}
Connect NatsWires::at_cloud(const TierId& edge) const {
  return between_tiers(edge, transport::NatsChannelSide::accepts);
}
Connect NatsWires::between_tiers(const TierId& edge, transport::NatsChannelSide side) const {
  auto options = with_maps(across_brokers(options_of(of_cloud(edge), edge.str(), side), domain_at(edge)));
  return connect(connection_, in_streams_of(kMapStream, std::move(options)));
}
std::string NatsWires::domain_at(const TierId& edge) const {
  for (const EdgeEntry& entry : edges_)
    if (entry.id == edge.str()) return domain_of(entry);
  return "";
}

std::shared_ptr<transport::Board> NatsWires::board() const {
  return std::make_shared<transport::NatsBoard>(connection_, kBoard);
}
transport::NatsBoard NatsWires::board_of_workers() const { return {connection_, kWorkers}; }
Connect NatsWires::to_worker(const std::string& worker) const {
  return of_work(worker, transport::NatsChannelSide::opens);
}
Connect NatsWires::at_worker(const std::string& worker) const {
  return of_work(worker, transport::NatsChannelSide::accepts);
}
Connect NatsWires::of_work(const std::string& worker, transport::NatsChannelSide side) const {
  return connect(connection_, in_streams_of(kWorkStream, with_maps(options_of(kWork, worker, side))));
}
std::optional<transport::NatsBoard> NatsWires::board_of(const TierId& edge) const {
  const std::string domain = domain_at(edge);
  if (domain.empty()) return std::nullopt;
  return transport::NatsBoard(connection_, kBoard, domain);
}
std::shared_ptr<transport::Board> NatsWires::plans() const {
  return std::make_shared<transport::NatsBoard>(connection_, kPlans);
}

}  // namespace mapweave::runtime
