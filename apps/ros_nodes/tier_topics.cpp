#include "tier_topics.h"

#include "map_publisher.h"
#include "paced_thread.h"
#include "robot_topics.h"
#include "ros_messages.h"

#include <map_msgs/SaveMap.h>
#include <mapweave/core/log.h>
#include <mapweave/exporters/map_folder.h>
#include <mapweave/exporters/map_server.h>
#include <mapweave/runtime/run_configuration.h>
#include <nav_msgs/GetMap.h>
#include <nav_msgs/LoadMap.h>

#include <algorithm>
#include <optional>
#include <utility>

namespace mapweave::ros_nodes {
namespace {

using namespace std::chrono_literals;

constexpr auto kBetweenLooks = 100ms;

std::vector<std::string> names_in(const runtime::RunPlan& plan) {
  std::vector<std::string> names{runtime::cloud_tier().str()};
  for (const TierId& edge : plan.edges) names.push_back(edge.str());
  for (const runtime::PlannedRobot& robot : plan.robots) names.push_back(robot.id.str());
  return names;
}

PublishedRobot published(const runtime::RunConfiguration& all, const runtime::PlannedRobot& robot) {
  const rawlog::ReadOptions& reading = configuration_of(all, robot).reading;
  PublishedRobot one;
  one.robot = robot.id;
  one.odometry_topic = [topics = RobotTopics(robot, all)] { return topics.odometry(); };
  if (all.robots.size() > 1)
    one.frame_prefix = (reading.robot_namespace.empty() ? robot.id.str() : reading.robot_namespace) + "/";
  one.robot_frame = reading.robot_frame;
  return one;
}

MapPublisherOptions publisher_options(const runtime::RunConfiguration& configuration, const TierOfTeam& tier,
                                      const RosNames& names) {
  MapPublisherOptions options;
  options.tier = tier.name;
  if (!tier.shows_team_frame) {
    options.team_frame = names.of(tier.name) + "/team";
    options.team_transforms = TeamTransforms::below;
  }
  options.grid = configuration.compose;
  options.cloud = configuration.output.cloud;
  options.robots = tier.robots;
  return options;
}

RobotMapsOptions robot_options(const runtime::RunConfiguration& configuration, const runtime::RunPlan& plan,
                               const TierOfTeam& tier) {
  RobotMapsOptions options;
  options.grid = configuration.compose;
  for (const runtime::PlannedRobot& robot : plan.robots)
    if (std::find(tier.robots.begin(), tier.robots.end(), robot.id) != tier.robots.end())
      options.robots.push_back(published(configuration, robot));
  return options;
}

}  // namespace

class TierTopics::State {
 public:
  State(RosNode& node, const runtime::RunConfiguration& configuration, const runtime::RunPlan& plan, TierOfTeam tier,
        Maps maps)
      : configuration_(configuration),
        tier_(std::move(tier)),
        preview_(std::move(maps.preview)),
        names_(names_in(plan)),
        options_(publisher_options(configuration, tier_, names_)),
        publisher_(node.handle(), names_, options_, pool_) {
    const std::string prefix = names_.of(tier_.name) + "/";
    loaded_ = node.handle().advertise<nav_msgs::OccupancyGrid>(prefix + "loaded_map", 1, true);
    node.serve(prefix + "save_map", &State::save_map, this);
    node.serve(prefix + "load_map", &State::load_map, this);
    node.serve(prefix + "static_map", &State::static_map, this);
    drawer_.emplace([this] { publisher_.publish(preview_()); }, kBetweenLooks);
    if (!maps.of_robot) return;
    robots_publisher_.emplace(node.handle(), names_, robot_options(configuration, plan, tier_),
                              std::move(maps.of_robot), pool_of_robots_);
    robots_drawer_.emplace([this] { robots_publisher_->publish(); }, kBetweenLooks);
  }

 private:
  const Map* largest(const std::shared_ptr<const runtime::LivePreview>& preview) const {
    return preview != nullptr && !preview->parts.empty() ? &preview->parts.front().map : nullptr;
  }

  OccupancyGrid grid_of(const Map& map) const {
    WorkerPool alone(1);
    return fusion::compose_grid(map, configuration_.compose, alone);
  }

  template <class Work>
  bool answered(const char* what, const Work& work) const {
    try {
      return work();
    } catch (const Error& error) {
      log(LogLevel::warning, std::string(what) + ": " + error.what());
    }
    return false;
  }

  bool save_map(map_msgs::SaveMap::Request& request, map_msgs::SaveMap::Response&) {
    return answered("save_map", [&] {
      const auto preview = preview_();
      const Map* map = largest(preview);
      if (map == nullptr) throw Error(ErrorCode::kMissing, "there is no map yet", tier_.name, "wait for the first one");
      if (request.filename.data.empty())
        throw Error(ErrorCode::kBadInput, "names no folder", "filename", "name a folder for the files");
      const std::filesystem::path folder = request.filename.data;
      write_map_folder(folder, *map, grid_of(*map), folder_options(configuration_.output, tier_.name));
      log(LogLevel::info, tier_.name + ": the map so far is in " + folder.string());
      return true;
    });
  }

  bool load_map(nav_msgs::LoadMap::Request& request, nav_msgs::LoadMap::Response& response) {
    const bool is_loaded = answered("load_map", [&] {
      response.map = grid_message(exporters::read_map_server(request.map_url), options_.team_frame);
      response.map.header.stamp = ros::Time::now();
      response.result = nav_msgs::LoadMap::Response::RESULT_SUCCESS;
      loaded_.publish(response.map);
      return true;
    });
    if (!is_loaded) response.result = nav_msgs::LoadMap::Response::RESULT_INVALID_MAP_DATA;
    return true;
  }

  bool static_map(nav_msgs::GetMap::Request&, nav_msgs::GetMap::Response& response) {
    return answered("static_map", [&] {
      const auto preview = preview_();
      const Map* map = largest(preview);
      if (map == nullptr) throw Error(ErrorCode::kMissing, "there is no map yet", tier_.name, "wait for the first one");
      response.map = grid_message(grid_of(*map), options_.team_frame);
      response.map.header.stamp = ros::Time::now();
      return true;
    });
  }

  const runtime::RunConfiguration& configuration_;
  const TierOfTeam tier_;
  const Preview preview_;
  const RosNames names_;
  const MapPublisherOptions options_;
  WorkerPool pool_{1}, pool_of_robots_{1};
  MapPublisher publisher_;
  std::optional<RobotMapsPublisher> robots_publisher_;
  ros::Publisher loaded_;
  std::optional<PacedThread> drawer_, robots_drawer_;  // the last members: they use the others
};

TierTopics::TierTopics(RosNode& node, const runtime::RunConfiguration& configuration, const runtime::RunPlan& plan,
                       TierOfTeam tier, Maps maps)
    : state_(std::make_unique<State>(node, configuration, plan, std::move(tier), std::move(maps))) {}
TierTopics::~TierTopics() = default;

}  // namespace mapweave::ros_nodes
