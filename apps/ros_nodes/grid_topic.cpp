#include "on_demand_topic.h"
#include "ros_messages.h"

#include <algorithm>

namespace mapweave::ros_nodes {
namespace {

constexpr std::uint32_t kMostWaitingUpdates = 100;  // none may be lost: each rests on the one before

}  // namespace

GridTopic::GridTopic(ros::NodeHandle node, const std::string& topic)
    : updates_(node.advertise<map_msgs::OccupancyGridUpdate>(
          topic + "_updates", kMostWaitingUpdates,
          [this](const ros::SingleSubscriberPublisher& one) { takers_.add(one.getSubscriberName()); },
          [this](const ros::SingleSubscriberPublisher& one) { takers_.remove(one.getSubscriberName()); })),
      grid_(node, topic, [this](const auto& before, const auto& now) { return send_update(before, now); }) {}

bool GridTopic::send_update(const nav_msgs::OccupancyGrid& before, const nav_msgs::OccupancyGrid& now) {
  const auto of_grid = grid_.subscribers(), of_updates = takers_.all();
  if (!std::includes(of_updates.begin(), of_updates.end(), of_grid.begin(), of_grid.end())) return false;
  auto update = grid_update(before, now);
  if (!update) return false;
  update->header.stamp = ros::Time::now();
  updates_.publish(*update);
  return true;
}

}  // namespace mapweave::ros_nodes
