#pragma once
// The cameras of a robot that maps on board and shares while it drives (server.share): each on a wire of its own to its
// edge's camera map server.

#include <mapweave/runtime/camera_link.h>
#include <mapweave/runtime/camera_task.h>
#include <mapweave/runtime/live_robot.h>

#include <atomic>
#include <deque>
#include <functional>
#include <string>
#include <vector>

namespace mapweave::runtime {

class SharingCameras {
 public:
  using Connect = std::function<std::shared_ptr<transport::Channel>(int number)>;
  SharingCameras(const RobotId& robot, const RunConfiguration& configuration, const LiveOptions& live, Connect connect);

  // --- Of who maps. clients: the robot's, those before and more.
  // Each says and receives what is due by the stamps of its data. Never waits.
  void exchange(const std::vector<CameraTask::Client>& clients, Stamp now);
  // No more frames come: the rest is published, which nobody waits for where the server is away. What the server keeps
  // of what a camera has forgotten is waited for, since its map would lack that; `give_up` ends it.
  void finish(const std::vector<CameraTask::Client>& clients, const std::atomic<bool>& give_up);
  std::vector<std::string> notes() const;  // for people, at the end: who mapped alone, and why

  // --- Of who connects.
  void keep_wires();

  LiveRobotCounts::Sharing counts() const;  // thread-safe

 private:
  CameraLink& link_of(const CameraTask::Client& client);
  void count(const std::vector<CameraTask::Client>& clients);
  void finish(const CameraTask::Client& client, const std::atomic<bool>& give_up);

  const RobotId robot_;
  const CameraLinkOptions options_;
  const double patience_s_;
  const Connect connect_;
  std::optional<Stamp> first_, last_;  // moments
  mutable std::mutex mutex_;
  std::deque<CameraLink> links_;  // of the clients, in the order in which they began; only grows
  LiveRobotCounts::Sharing counts_;
};

}  // namespace mapweave::runtime
