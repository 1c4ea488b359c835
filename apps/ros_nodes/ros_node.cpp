#include "ros_node.h"

#include <mapweave/core/interrupt.h>
#include <mapweave/core/log.h>
#include <ros/connection_manager.h>
#include <ros/network.h>
#include <ros/publication.h>
#include <ros/topic_manager.h>
#include <ros/xmlrpc_manager.h>

#include <unistd.h>

#include <csignal>

namespace mapweave::ros_nodes {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;

// By which programs of mapweave know each other.
constexpr char kMark[] = "is_mapweave";

void wait_for_master(app::StopSignals& stops) {
  constexpr auto kPatience = 15s;
  auto next = Clock::now() + 1s;
  while (!ros::master::check()) {
    if (Clock::now() >= next) {
      log(LogLevel::warning, "no ROS master answers at " + ros::master::getURI() +
                                 "; it is waited for. Start roscore, or set ROS_MASTER_URI");
      next = Clock::now() + kPatience;
    }
    if (stops.wait(200ms)) throw Interrupted("interrupted while it waited for the ROS master");
  }
}

// Says to this node what a master says when publishers come.
void connect(const std::string& topic, const XmlRpc::XmlRpcValue& publishers) {
  std::string host;
  std::uint32_t port = 0;
  if (!ros::network::splitURI(ros::XMLRPCManager::instance()->getServerURI(), host, port)) return;
  XmlRpc::XmlRpcClient client(host.c_str(), static_cast<int>(port), "/");
  XmlRpc::XmlRpcValue request, response;
  request[0] = ros::this_node::getName();
  request[1] = topic;
  request[2] = publishers;
  client.execute("publisherUpdate", request, response);
}

// Roscpp ends all publishers at once where `rosnode kill`, or a node of the same name, asks the node to end, and traps
// what publishes after that. Here it is Ctrl-C.
void end_as_interrupted(XmlRpc::XmlRpcValue& request, XmlRpc::XmlRpcValue& response) {
  const bool has_reason = request.getType() == XmlRpc::XmlRpcValue::TypeArray && request.size() > 1 &&
                          request[1].getType() == XmlRpc::XmlRpcValue::TypeString;
  log(LogLevel::warning,
      "ROS asks this node to end" + (has_reason ? ": " + std::string(request[1]) : std::string("; it says no reason")));
  ::kill(::getpid(), SIGINT);
  response = ros::xmlrpc::responseInt(1, "", 0);
}

void take_requests_to_end() {
  constexpr char kRequest[] = "shutdown";
  const ros::XMLRPCManagerPtr& requests = ros::XMLRPCManager::instance();
  requests->unbind(kRequest);
  requests->bind(kRequest, end_as_interrupted);
}

}  // namespace

bool is_node_of_mapweave(const std::string& node) {
  bool is_ours = false;
  ros::param::get(node + "/" + kMark, is_ours);
  return is_ours;
}

RosNode::RosNode(app::StopSignals& stops) {
  wait_for_master(stops);
  handle_.emplace();
  take_requests_to_end();
  ros::param::set(ros::this_node::getName() + "/" + kMark, true);
  spinner_.emplace(1);
  spinner_->start();
}

RosNode::~RosNode() {
  spinner_->stop();
  ros::param::del(ros::this_node::getName() + "/" + kMark);
}

void RosNode::keep() {
  if (Clock::now() < next_) return;
  next_ = Clock::now() + 1s;
  XmlRpc::XmlRpcValue request, response, payload;
  request[0] = request[1] = ros::this_node::getName();
  if (!ros::master::check() || ros::master::execute("lookupNode", request, response, payload, false)) return;
  log(LogLevel::warning, "the ROS master was started again; this node registers anew");
  register_again();
}

void RosNode::register_again() const {
  const std::string us = ros::this_node::getName(), our_uri = ros::XMLRPCManager::instance()->getServerURI();
  const auto ask = [&](const char* what, const std::string& name, const std::string& more) {
    XmlRpc::XmlRpcValue request, response, payload;
    request[0] = us;
    request[1] = name;
    request[2] = more;
    request[3] = our_uri;
    ros::master::execute(what, request, response, payload, false);
    return payload;
  };
  ros::param::set(us + "/" + kMark, true);
  const ros::TopicManagerPtr& topics = ros::TopicManager::instance();
  ros::V_string names;
  topics->getAdvertisedTopics(names);
  for (const std::string& name : names)
    if (const ros::PublicationPtr publication = topics->lookupPublication(name))
      ask("registerPublisher", name, publication->getDataType());
  names.clear();
  topics->getSubscribedTopics(names);
  for (const std::string& name : names) {
    XmlRpc::XmlRpcValue publishers = ask("registerSubscriber", name, "*");
    if (publishers.getType() == XmlRpc::XmlRpcValue::TypeArray && publishers.size() > 0) connect(name, publishers);
  }
  const std::string service_uri =
      "rosrpc://" + ros::network::getHost() + ":" + std::to_string(ros::ConnectionManager::instance()->getTCPPort());
  for (const ros::ServiceServer& service : services_) ask("registerService", service.getService(), service_uri);
}

}  // namespace mapweave::ros_nodes
