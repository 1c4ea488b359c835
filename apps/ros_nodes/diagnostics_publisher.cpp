#include "diagnostics_publisher.h"

#include "ros_messages.h"

#include <mapweave/core/log.h>
#include <nlohmann/json.hpp>

namespace mapweave::ros_nodes {

DiagnosticsPublisher::DiagnosticsPublisher(ros::NodeHandle node, Status status)
    : status_(std::move(status)),
      publisher_(node.advertise<diagnostic_msgs::DiagnosticArray>("/diagnostics", 10)),
      timer_(node.createWallTimer(ros::WallDuration(1.0), [this](const ros::WallTimerEvent&) { publish(); })) {}

void DiagnosticsPublisher::publish() {
  nlohmann::ordered_json status;
  try {
    status = status_();
    problem_.clear();
  } catch (const std::exception& error) {
    if (problem_ != error.what()) log(LogLevel::warning, std::string("no diagnostics: ") + error.what());
    problem_ = error.what();
  }
  diagnostic_msgs::DiagnosticArray message = diagnostics_message(status);
  message.header.stamp = ros::Time::now();
  publisher_.publish(message);
}

}  // namespace mapweave::ros_nodes
