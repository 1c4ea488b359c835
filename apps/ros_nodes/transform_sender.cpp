#include "transform_sender.h"

namespace mapweave::ros_nodes {

TransformSender::TransformSender(ros::NodeHandle node, double rate_hz)
    : period_(1.0 / rate_hz), timer_(node.createTimer(period_, [this](const ros::TimerEvent&) { send(); })) {}

void TransformSender::set(std::vector<geometry_msgs::TransformStamped> transforms) {
  const std::lock_guard lock(mutex_);
  transforms_ = std::move(transforms);
}

void TransformSender::send() {
  const ros::Time now = ros::Time::now();
  const std::lock_guard lock(mutex_);
  // tf2 complains of a second transform for one time.
  if (transforms_.empty() || now.isZero() || now == sent_) return;
  sent_ = now;
  for (geometry_msgs::TransformStamped& transform : transforms_) transform.header.stamp = now + period_;
  broadcaster_.sendTransform(transforms_);
}

}  // namespace mapweave::ros_nodes
