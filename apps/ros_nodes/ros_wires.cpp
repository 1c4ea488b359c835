#include "ros_wires.h"

#include <mapweave/core/error.h>
#include <mapweave/core/format.h>
#include <mapweave/core/little_endian.h>
#include <mapweave/core/stamp.h>
#include <mapweave/core/stopwatch.h>
#include <mapweave/transport/direct_channel.h>

#include <ros/ros.h>
#include <std_msgs/UInt8MultiArray.h>

#include <algorithm>
#include <cctype>
#include <utility>

namespace mapweave::ros_nodes {
namespace {

constexpr std::size_t kLongestWord = std::size_t{256} << 10;

class RosChannel : public transport::DirectChannel {
 public:
  RosChannel(transport::DirectChannelOptions options, const std::string& out, const std::string& in)
      : RosChannel(std::move(options), ros::NodeHandle().advertise<std_msgs::UInt8MultiArray>(out, kUnbounded), in) {}
  ~RosChannel() override { subscriber_.shutdown(); }  // waits for a callback

 private:
  // The channel bounds what is on its path, and what is lost here it sends again.
  static constexpr std::uint32_t kUnbounded = 0;

  RosChannel(transport::DirectChannelOptions options, const ros::Publisher& publisher, const std::string& in)
      : DirectChannel(std::move(options), [publisher](std::string packet) {
          std_msgs::UInt8MultiArray message;
          message.data.assign(packet.begin(), packet.end());
          publisher.publish(message);
        }) {
    subscriber_ = ros::NodeHandle().subscribe<std_msgs::UInt8MultiArray>(
        in, kUnbounded, [this](const std_msgs::UInt8MultiArray::ConstPtr& message) {
          take({reinterpret_cast<const char*>(message->data.data()), message->data.size()});
        });
  }

  ros::Subscriber subscriber_;
};

// Words are parameters: the time at which each was said, by its program's clock, and its bytes.
class RosBoard : public transport::Board {
 public:
  explicit RosBoard(std::string name) : prefix_(ros::names::resolve("mapweave_boards/" + std::move(name)) + "/") {}

  void ensure(std::chrono::milliseconds) override {}

  bool put(const std::string& name, std::string_view word) override {
    if (word.size() > kLongestWord) return false;
    std::string bytes;
    append_number(bytes, now_ns());
    bytes += word;
    XmlRpc::XmlRpcValue request, response, payload;
    request[0] = ros::this_node::getName();
    request[1] = prefix_ + token_of(name);
    request[2] = XmlRpc::XmlRpcValue(bytes.data(), static_cast<int>(bytes.size()));
    return ros::master::execute("setParam", request, response, payload, false);
  }

  std::optional<Word> last(const std::string& name, std::chrono::milliseconds) const override {
    XmlRpc::XmlRpcValue request, response, payload;
    request[0] = ros::this_node::getName();
    request[1] = prefix_ + token_of(name);
    if (!ros::master::execute("getParam", request, response, payload, false)) return std::nullopt;
    if (payload.getType() != XmlRpc::XmlRpcValue::TypeBase64)
      throw Error(ErrorCode::kCorrupt, "the parameter " + std::string(request[1]) + " is none of mapweave's");
    const XmlRpc::XmlRpcValue::BinaryData& binary = payload;
    const std::string bytes(binary.begin(), binary.end());
    if (bytes.size() < sizeof(std::int64_t))
      throw Error(ErrorCode::kCorrupt, "the parameter " + std::string(request[1]) + " is too short");
    const std::chrono::nanoseconds stored(number_at<std::int64_t>(bytes, 0));
    return Word{bytes.substr(sizeof(std::int64_t)), std::chrono::system_clock::time_point(stored)};
  }

 private:
  // Names of parameters have letters, digits and underscores.
  static std::string token_of(const std::string& name) {
    std::string token;
    for (const char letter : name)
      if (std::isalnum(static_cast<unsigned char>(letter)) != 0)
        token += letter;
      else
        token += format("_%02x", static_cast<unsigned>(static_cast<unsigned char>(letter)));
    return token;
  }

  const std::string prefix_;
};

std::vector<std::string> ids_of_robots(const runtime::RunPlan& plan) {
  std::vector<std::string> ids;
  for (const runtime::PlannedRobot& robot : plan.robots) ids.push_back(robot.id.str());
  return ids;
}

std::vector<std::string> ids_of_edges(const runtime::RunPlan& plan) {
  std::vector<std::string> ids;
  for (const TierId& edge : plan.edges) ids.push_back(edge.str());
  return ids;
}

runtime::Connect connect(const std::string& wire, transport::DirectChannelOptions options) {
  const std::string root = "mapweave_wires/" + wire, up = root + "/up", down = root + "/down";
  options.peer = wire;
  return [options, out = options.opens ? up : down, in = options.opens ? down : up] {
    return std::make_shared<RosChannel>(options, out, in);
  };
}

}  // namespace

RosWires::RosWires(const runtime::RunConfiguration& configuration, const runtime::RunPlan& plan)
    : edges_(ids_of_edges(plan)),
      robots_(ids_of_robots(plan)),
      camera_queue_bytes_(static_cast<std::size_t>(configuration.live.camera_map_server.queue_kb) << 10) {
  for (const runtime::EdgeEntry& edge : configuration.edges)
    if (!edge.broker.empty())
      throw Error(ErrorCode::kBadInput, "edge " + edge.id + " has a broker of its own, but the others talk over ROS",
                  "edges.broker", "remove it, or name a NATS server in live.broker");
  if (!configuration.live.keys.empty())
    throw Error(ErrorCode::kBadInput, "topics of ROS know no keys", "live.keys",
                "remove it, or name a NATS server in live.broker");
}

runtime::Connect RosWires::of_robot(const RobotId& robot, const TierId& edge, Side side) const {
  transport::DirectChannelOptions options;
  options.opens = side == Side::opens;
  return connect(edges_.of(edge.str()) + "/" + robots_.of(robot.str()), options);
}
runtime::Connect RosWires::of_camera(const RobotId& robot, int number, const TierId& edge, Side side) const {
  transport::DirectChannelOptions options;
  options.opens = side == Side::opens;
  options.priorities = runtime::urgent_of_cameras();
  options.limits.bytes = camera_queue_bytes_;
  return connect(edges_.of(edge.str()) + "/" + robots_.of(robot.str()) + "/camera_" + std::to_string(number), options);
}
runtime::Connect RosWires::of_cloud(const TierId& edge, Side side) const {
  transport::DirectChannelOptions options;
  options.opens = side == Side::opens;
  options.limits.bytes = options.received.message_bytes = runtime::kLongestOfMaps;
  return connect(edges_.of(edge.str()) + "/cloud", options);
}

runtime::Connect RosWires::from_robot(const RobotId& robot, const TierId& edge) const {
  return of_robot(robot, edge, Side::opens);
}
runtime::Connect RosWires::at_edge(const RobotId& robot, const TierId& edge) const {
  return of_robot(robot, edge, Side::accepts);
}
runtime::Connect RosWires::from_camera(const RobotId& robot, int number, const TierId& edge) const {
  return of_camera(robot, number, edge, Side::opens);
}
runtime::Connect RosWires::at_camera_map_server(const RobotId& robot, int number, const TierId& edge) const {
  return of_camera(robot, number, edge, Side::accepts);
}
runtime::Connect RosWires::from_edge(const TierId& edge) const { return of_cloud(edge, Side::opens); }
runtime::Connect RosWires::at_cloud(const TierId& edge) const { return of_cloud(edge, Side::accepts); }

std::shared_ptr<transport::Board> RosWires::board() const { return std::make_shared<RosBoard>("status"); }
std::shared_ptr<transport::Board> RosWires::plans() const { return std::make_shared<RosBoard>("plan"); }

}  // namespace mapweave::ros_nodes
