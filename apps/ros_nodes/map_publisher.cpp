#include "map_publisher.h"

#include "on_demand_topic.h"
#include "robot_map.h"
#include "ros_messages.h"
#include "topic_problems.h"
#include "transform_sender.h"

namespace mapweave::ros_nodes {
namespace {

// Grids as messages; nullopt for one without cells, which viewers take for an error.
class GridMaker {
 public:
  GridMaker(const fusion::ComposeOptions& options, WorkerPool& pool, Problems& problems)
      : options_(options), pool_(pool), problems_(problems) {}
  std::optional<nav_msgs::OccupancyGrid> operator()(const Map& map, const std::string& topic,
                                                    const std::string& frame) const {
    const auto grid = problems_.guarded("no " + topic, [&] { return fusion::compose_grid(map, options_, pool_); });
    if (!grid || grid->empty()) return std::nullopt;
    return grid_message(*grid, frame);
  }

 private:
  const fusion::ComposeOptions& options_;
  WorkerPool& pool_;
  Problems& problems_;
};

}  // namespace

class MapPublisher::State {
 public:
  State(ros::NodeHandle node, RosNames names, MapPublisherOptions options, WorkerPool& pool)
      : names_(std::move(names)),
        options_(std::move(options)),
        make_grid_(options_.grid, pool, problems_),
        prefix_(names_.of(options_.tier)),
        grid_(node, prefix_ + "/map"),
        cloud_(node, prefix_ + "/cloud"),
        graph_(node, prefix_ + "/graph"),
        sender_(node, options_.transforms_hz) {
    for (const RobotId& robot : options_.robots)
      if (names_.of(robot.str()) == prefix_)
        throw Error(ErrorCode::kBadInput, "a robot and its tier are both called '" + prefix_ + "' in topics of ROS",
                    options_.tier, "give one of them another name");
  }

  void publish(const std::shared_ptr<const runtime::LivePreview>& preview) {
    if (preview == nullptr) return;
    if (preview != preview_) take(preview);
    if (preview_->parts.empty()) return;
    const Map& map = preview_->parts.front().map;
    grid_.show(looks_, [&] { return make_grid_(map, prefix_ + "/map", options_.team_frame); });
    cloud_.show(looks_, [&] {
      return std::optional(cloud_message(exporters::map_cloud(map, options_.cloud), options_.team_frame));
    });
    graph_.show(version_, [&] { return std::optional(graph_message(map, options_.team_frame)); });
  }

 private:
  void take(const std::shared_ptr<const runtime::LivePreview>& preview) {
    const bool is_known = preview_ != nullptr && !preview_->parts.empty() && !preview->parts.empty() &&
                          looks_the_same(preview_->parts.front().map, preview->parts.front().map);
    if (!is_known) ++looks_;
    ++version_;
    preview_ = preview;
    sender_.set(team_transforms());
  }

  std::vector<geometry_msgs::TransformStamped> team_transforms() const {
    std::vector<geometry_msgs::TransformStamped> transforms;
    if (options_.team_transforms == TeamTransforms::none || preview_->parts.empty()) return transforms;
    for (const auto& [robot, team_from_start] : preview_->parts.front().part_from_start) {
      const std::string frame = names_.of(robot.str()) + "/map";
      if (options_.team_transforms == TeamTransforms::below)
        return {transform_between(frame, options_.team_frame, inverse(team_from_start))};
      transforms.push_back(transform_between(options_.team_frame, frame, team_from_start));
    }
    return transforms;
  }

  const RosNames names_;
  const MapPublisherOptions options_;
  Problems problems_;
  const GridMaker make_grid_;
  const std::string prefix_;
  std::shared_ptr<const runtime::LivePreview> preview_;
  std::uint64_t version_ = 0, looks_ = 0;  // of the preview; of what its largest part looks like
  GridTopic grid_;
  OnDemandTopic<sensor_msgs::PointCloud2> cloud_;
  OnDemandTopic<visualization_msgs::MarkerArray> graph_;
  TransformSender sender_;
};

MapPublisher::MapPublisher(ros::NodeHandle node, RosNames names, MapPublisherOptions options, WorkerPool& pool)
    : state_(std::make_unique<State>(std::move(node), std::move(names), std::move(options), pool)) {}

MapPublisher::~MapPublisher() = default;

void MapPublisher::publish(const std::shared_ptr<const runtime::LivePreview>& preview) { state_->publish(preview); }

}  // namespace mapweave::ros_nodes
