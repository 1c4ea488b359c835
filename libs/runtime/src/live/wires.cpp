#include <mapweave/runtime/wires.h>
#include <mapweave/tiers/subjects.h>

#include <algorithm>

namespace mapweave::runtime {

std::vector<std::vector<std::string>> urgent_of_cameras() {
  namespace subject = tiers::subject;
  return {{subject::kHello, subject::kPlaceRequest, subject::kWelcome, subject::kReceipts, subject::kPlace,
           subject::kRefusal}};
}

void ServedWires::remove(const std::string& name) {
  const auto wire = wires_.find(name);
  if (wire == wires_.end()) return;
  if (wire->second.channel != nullptr) wire->second.channel->close();
  wires_.erase(wire);
}

void ServedWires::keep() {
  for (auto& [name, wire] : wires_)
    if (wire.channel == nullptr || wire.channel->is_closed()) {
      wire.channel = wire.accept();
      serve_(wire.channel);
    }
}

CameraWires::CameraWires(const Wires& wires, const TierId& edge, LiveEdge& server)
    : wires_(wires), edge_(edge), server_(server) {}

void CameraWires::add(const RobotId& robot) {
  robots_.try_emplace(robot, [&server = server_, robot](std::shared_ptr<transport::Channel> channel) {
    server.serve_camera(robot, std::move(channel));
  });
}

void CameraWires::keep() {
  constexpr std::chrono::milliseconds kBetween{500};
  const auto now = std::chrono::steady_clock::now();
  const bool looks = now >= next_;
  if (looks) next_ = now + kBetween;
  for (auto& [id, robot] : robots_) {
    if (looks) {
      const std::size_t wanted = std::min(server_.cameras_of(id) + 1, kMostSharingCameras);
      for (; robot.count < wanted; ++robot.count)
        robot.wires.add(std::to_string(robot.count),
                        wires_.at_camera_map_server(id, static_cast<int>(robot.count), edge_));
    }
    robot.wires.keep();
  }
}

}  // namespace mapweave::runtime
