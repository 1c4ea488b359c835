#pragma once
// Topics whose messages cost something: made only while somebody subscribes, and the newest for who comes late.

#include <map_msgs/OccupancyGridUpdate.h>
#include <nav_msgs/OccupancyGrid.h>
#include <nav_msgs/Path.h>
#include <ros/ros.h>
#include <sensor_msgs/PointCloud2.h>
#include <visualization_msgs/MarkerArray.h>

#include <cstdint>
#include <functional>
#include <mutex>
#include <optional>
#include <set>
#include <string>
#include <utility>

namespace mapweave::ros_nodes {

inline void set_stamp(nav_msgs::OccupancyGrid& message, const ros::Time& stamp) {
  message.header.stamp = message.info.map_load_time = stamp;
}
inline void set_stamp(nav_msgs::Path& message, const ros::Time& stamp) { message.header.stamp = stamp; }
inline void set_stamp(sensor_msgs::PointCloud2& message, const ros::Time& stamp) { message.header.stamp = stamp; }
// Markers keep time 0, at which viewers take the newest transform.
inline void set_stamp(visualization_msgs::MarkerArray&, const ros::Time&) {}

// The names of the nodes that subscribe to a topic. Thread-safe.
class SubscriberNames {
 public:
  void add(const std::string& name) {
    const std::lock_guard lock(mutex_);
    names_.insert(name);
  }
  void remove(const std::string& name) {
    const std::lock_guard lock(mutex_);
    const auto found = names_.find(name);
    if (found != names_.end()) names_.erase(found);
  }
  std::multiset<std::string> all() const {
    const std::lock_guard lock(mutex_);
    return names_;
  }

 private:
  mutable std::mutex mutex_;
  std::multiset<std::string> names_;
};

// Behaves as a latched topic, but for what it costs while nobody subscribes. The node's callback queue must be served:
// from there a new subscriber gets what is newest, where it comes in time for a new message twice. Roscpp says nothing
// of a second subscriber in one process, which gets the next message. Messages are stamped when they are sent, so that
// a viewer that came late finds their transforms.
template <class Message>
class OnDemandTopic {
 public:
  // Sends what changed otherwise; true: all who subscribe have it now.
  using SendChange = std::function<bool(const Message& before, const Message& now)>;

  OnDemandTopic(ros::NodeHandle node, const std::string& topic, SendChange send_change = {})
      : send_change_(std::move(send_change)) {
    publisher_ = node.advertise<Message>(
        topic, 1, [this](const ros::SingleSubscriberPublisher& subscriber) { welcome(subscriber); },
        [this](const ros::SingleSubscriberPublisher& subscriber) { names_.remove(subscriber.getSubscriberName()); });
  }
  OnDemandTopic(const OnDemandTopic&) = delete;
  OnDemandTopic& operator=(const OnDemandTopic&) = delete;

  // Makes the message of this version where somebody subscribes and it is not made yet, and sends it where it differs
  // from the last one. make() returns nullopt where there is nothing to send. One thread at a time; connections of
  // subscribers go on meanwhile.
  template <class Make>
  void show(std::uint64_t version, Make&& make) {
    if (publisher_.getNumSubscribers() == 0) return forget();
    if (version_ == version) return;
    std::optional<Message> now = make();
    const std::lock_guard lock(mutex_);
    version_ = version;
    if (!now) return;
    if (last_) {
      set_stamp(*now, ros::Time());
      set_stamp(*last_, ros::Time());
      if (*now == *last_) return;
    }
    const std::optional<Message> before = std::exchange(last_, std::move(now));
    if (before && send_change_ && send_change_(*before, *last_)) return;
    set_stamp(*last_, ros::Time::now());
    publisher_.publish(*last_);
  }

  // Who subscribes from now on gets nothing until something is shown again.
  void forget() {
    const std::lock_guard lock(mutex_);
    last_.reset();
    version_.reset();
  }

  std::multiset<std::string> subscribers() const { return names_.all(); }

 private:
  void welcome(const ros::SingleSubscriberPublisher& subscriber) {
    names_.add(subscriber.getSubscriberName());
    const std::lock_guard lock(mutex_);
    if (!last_) return;
    set_stamp(*last_, ros::Time::now());
    subscriber.publish(*last_);
  }

  SendChange send_change_;
  SubscriberNames names_;
  std::mutex mutex_;
  std::optional<Message> last_;
  std::optional<std::uint64_t> version_;  // that was made last
  ros::Publisher publisher_;              // the last member: its callbacks end before what they use
};

// A grid on TOPIC, and what changed of it on TOPIC_updates (map_msgs/OccupancyGridUpdate): this alone is sent while
// every node that subscribes to the grid takes updates too, and the grid's size and origin stay. Else the whole grid
// is.
class GridTopic {
 public:
  GridTopic(ros::NodeHandle node, const std::string& topic);
  template <class Make>
  void show(std::uint64_t version, Make&& make) {
    grid_.show(version, std::forward<Make>(make));
  }
  void forget() { grid_.forget(); }

 private:
  bool send_update(const nav_msgs::OccupancyGrid& before, const nav_msgs::OccupancyGrid& now);

  SubscriberNames takers_;
  ros::Publisher updates_;
  OnDemandTopic<nav_msgs::OccupancyGrid> grid_;
};

}  // namespace mapweave::ros_nodes
