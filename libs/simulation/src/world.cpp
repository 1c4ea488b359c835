#include "carrying.h"
#include "furnishing.h"

#include <mapweave/simulation/world.h>

#include <mapweave/core/error.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/core/options.h>

#include <algorithm>
#include <cmath>
#include <deque>
#include <mutex>
#include <set>
#include <string>

namespace mapweave::simulation {
namespace {

constexpr std::int64_t kFirstMoment =
    1'600'000'000'000'000'000;              // of every world, nanoseconds since the UNIX epoch: September 2020
constexpr double kBetweenBuildings = 40.0;  // metres

std::string described(Point2 p) { return "(" + std::to_string(p.x) + ", " + std::to_string(p.y) + ")"; }

FloorPlan make_bare_plan(const BuildingOptions& options, std::uint64_t seed) {
  switch (options.kind) {
    case PlanKind::corridor: return make_corridor_plan(options.corridor, seed);
    case PlanKind::apartment: return make_apartment_plan(options.apartment, seed);
    case PlanKind::repeated_rooms: return make_repeated_rooms_plan(options.repeated_rooms, seed);
    case PlanKind::mirrored_rooms: return make_mirrored_rooms_plan(options.mirrored_rooms, seed);
    case PlanKind::hall: return make_hall_plan(options.hall, seed);
    case PlanKind::ring: return make_ring_plan(options.ring, seed);
    case PlanKind::warehouse: return make_warehouse_plan(options.warehouse, seed);
  }
  MAPWEAVE_EXPECT(false, "every kind of plan has its maker");
}

FloorPlan make_plan(const BuildingOptions& options, std::uint64_t seed) {
  return furnished(make_bare_plan(options, seed), options.furniture, seed);
}

// Where a lap leads, by targets: points of the world's frame.
class Tour {
 public:
  Tour(const RobotOptions& robot, const FloorPlan& plan, Point2 origin, std::uint64_t seed)
      : robot_(robot), numbers_(seed, "tour", robot.id) {
    for (const WaypointOptions& waypoint : robot.waypoints)
      waypoints_.push_back({origin.x + waypoint.x_m, origin.y + waypoint.y_m});
    if (!waypoints_.empty()) return;
    const int count = static_cast<int>(plan.rooms.size()), last = robot.last_room < 0 ? count - 1 : robot.last_room;
    if (last >= count || robot.first_room > last) {
      throw Error(ErrorCode::kBadInput,
                  "rooms " + std::to_string(robot.first_room) + " to " + std::to_string(last) +
                      " are asked for; the building has 0 to " + std::to_string(count - 1),
                  "robot '" + robot.id + "'", "change first_room and last_room");
    }
    rooms_.assign(plan.rooms.begin() + robot.first_room, plan.rooms.begin() + last + 1);
    if (robot.order == TourOrder::back) std::reverse(rooms_.begin(), rooms_.end());
  }

  std::vector<Point2> lap(std::uint64_t index) const {
    if (!waypoints_.empty()) return waypoints_;
    RandomNumbers numbers = numbers_.at(index);
    std::vector<Room> rooms = rooms_;
    if (rooms.size() == 1) rooms.resize(4, rooms_.front());  // then it looks around in there
    if (robot_.order == TourOrder::shuffled) {
      for (std::size_t i = rooms.size() - 1; i > 0; --i)
        std::swap(rooms[i], rooms[static_cast<std::size_t>(numbers.integer(0, static_cast<int>(i)))]);
    }
    const double spread = rooms_.size() == 1 ? 0.3 : 0.15;
    std::vector<Point2> targets;
    for (const Room& room : rooms) {
      const Point2 middle = room.inside.centre();
      const double x = numbers.uniform(-spread, spread), y = numbers.uniform(-spread, spread);
      targets.push_back({middle.x + x * room.inside.width(), middle.y + y * room.inside.height()});
    }
    return targets;
  }

 private:
  const RobotOptions& robot_;
  RandomStream numbers_;
  std::vector<Point2> waypoints_;
  std::vector<Room> rooms_;
};

// Drives laps until they are done, or until length_m where that is positive.
SimulatedTrajectory plan_trajectory(const RobotOptions& robot, const FloorPlan& plan, Point2 origin,
                                    const FreeSpace& space, const MotionOptions& motion, std::uint64_t seed) {
  const Tour tour(robot, plan, origin, seed);
  const RandomStream speeds(seed, "speed", robot.id);
  const auto reachable = [&](Point2 wanted) {
    const auto free = space.nearest_free(wanted);
    if (!free) {
      throw Error(ErrorCode::kBadInput, "there is no free point near " + described(wanted), "robot '" + robot.id + "'",
                  "move the waypoint or make motion.clearance_m smaller");
    }
    return *free;
  };
  std::vector<Leg> legs;
  double planned_m = 0.0;
  std::optional<Point2> start, at;
  const auto go = [&](Point2 to) {
    if (!at) {
      start = at = to;
      legs.push_back({{to, to}, motion.speed_min_m_per_s});
      return;
    }
    auto path = space.path(*at, to);
    if (!path) {
      throw Error(ErrorCode::kBadInput, "there is no path from " + described(*at) + " to " + described(to),
                  "robot '" + robot.id + "'", "make doors wider or motion.clearance_m smaller");
    }
    for (std::size_t i = 1; i < path->size(); ++i)
      planned_m += std::hypot((*path)[i].x - (*path)[i - 1].x, (*path)[i].y - (*path)[i - 1].y);
    legs.push_back(
        {std::move(*path), speeds.at(legs.size()).uniform(motion.speed_min_m_per_s, motion.speed_max_m_per_s)});
    at = to;
  };
  double wanted_m = robot.length_m;  // of the planned path; rounded corners will make it shorter
  std::uint64_t lap = 0;
  while (true) {
    do {
      throw_if_interrupted();
      const double before_m = planned_m;
      for (const Point2 target : tour.lap(lap)) go(reachable(target));
      if (robot.return_to_start) go(*start);
      if (robot.length_m > 0.0 && planned_m - before_m < 0.1) {
        throw Error(ErrorCode::kBadInput, "the tour leads nowhere, so no length can be driven",
                    "robot '" + robot.id + "'", "give it two waypoints or rooms");
      }
      ++lap;
    } while (robot.length_m > 0.0 ? planned_m < wanted_m : lap < static_cast<std::uint64_t>(robot.laps));
    SimulatedTrajectory trajectory = drive(legs, space, motion, robot.length_m);
    if (trajectory.length_m() >= robot.length_m - 1e-6) return trajectory;
    wanted_m = planned_m * 1.1;
  }
}

void check_together(const WorldOptions& options) {
  if (options.robots.empty())
    throw Error(ErrorCode::kBadInput, "the world has no robots", "robots", "list one as {id: alpha}");
  std::set<std::string> ids;
  for (const RobotOptions& robot : options.robots) {
    const std::string where = "robot '" + robot.id + "'";
    if (!is_valid_name(robot.id)) {
      throw Error(ErrorCode::kBadInput, "'" + robot.id + "' cannot be a robot's id", where,
                  "use letters, digits, '_', '-' and '.'");
    }
    if (!robot.edge.empty() && !is_valid_name(robot.edge)) {
      throw Error(ErrorCode::kBadInput, "'" + robot.edge + "' cannot be an edge's name", where,
                  "use letters, digits, '_', '-' and '.'");
    }
    for (const auto* cameras : {&robot.cameras, &options.cameras}) {
      std::set<std::string> labels;
      for (const CameraOptions& camera : *cameras) {
        if (!is_valid_name(camera.id)) {
          throw Error(ErrorCode::kBadInput, "'" + camera.id + "' cannot be a camera's id", where,
                      "use letters, digits, '_', '-' and '.'");
        }
        if (!labels.insert(camera.id).second)
          throw Error(ErrorCode::kBadInput, "two cameras have the id '" + camera.id + "'", where, "give each its own");
        if (camera.depth.max_range_m < camera.depth.min_range_m)
          throw Error(ErrorCode::kBadInput, "the greatest depth is under the least", "camera '" + camera.id + "'",
                      "change depth.max_range_m");
        const CameraModel model(camera.intrinsics());  // throws where the distortion is impossible
      }
    }
    if (!ids.insert(robot.id).second)
      throw Error(ErrorCode::kBadInput, "two robots have this id", where, "give each its own");
    if (robot.building < 0 || static_cast<std::size_t>(robot.building) >= options.buildings.size()) {
      throw Error(ErrorCode::kBadInput,
                  "there is no building " + std::to_string(robot.building) + "; there are " +
                      std::to_string(options.buildings.size()),
                  where, "buildings count from 0");
    }
  }
  if (options.motion.speed_max_m_per_s < options.motion.speed_min_m_per_s) {
    throw Error(ErrorCode::kBadInput, "the greatest speed is under the least", "motion", "change speed_max_m_per_s");
  }
  if (options.odometry.slip_max_deg < options.odometry.slip_min_deg) {
    throw Error(ErrorCode::kBadInput, "the greatest slip is under the least", "odometry", "change slip_max_deg");
  }
}

}  // namespace

struct World::State {
  WorldOptions options;
  std::vector<FloorPlan> buildings;
  std::vector<RayCaster> casters;
  std::vector<LaserSensor> lasers;  // one per building
  // One per building, painted when first looked at.
  struct LazyScene {
    std::once_flag once;
    std::unique_ptr<const Scene> scene;
  };
  mutable std::deque<LazyScene> scenes;
  std::vector<std::uint64_t> plan_seeds;
  std::vector<SimulatedTrajectory> trajectories;         // of robots, from their own starts
  std::vector<std::vector<Carry>> carries;               // of robots
  std::vector<FloorWaves> floors;                        // one per building
  std::vector<std::int64_t> first_ticks;                 // of robots: ticks of the world's clock before their starts
  std::vector<std::vector<SimulatedTrajectory>> people;  // per building, from the world's first moment
  std::int64_t tick_ns = 0;  // between odometry readings; whole microseconds, as trajectory files keep them

  double seconds(std::int64_t ticks) const { return static_cast<double>(ticks * tick_ns) * 1e-9; }

  // The others in a robot's building; their numbers count robots first.
  std::vector<Body> bodies_around(std::size_t robot, double seconds_of_world) const {
    const int building = options.robots[robot].building;
    std::vector<Body> bodies;
    for (std::size_t other = 0; other < trajectories.size() && options.robot_radius_m > 0.0; ++other) {
      if (other == robot || options.robots[other].building != building) continue;
      bodies.push_back({trajectories[other].at(seconds_of_world - seconds(first_ticks[other])), options.robot_radius_m,
                        options.robot_height_m, static_cast<int>(other)});
    }
    for (const SimulatedTrajectory& person : people[static_cast<std::size_t>(building)]) {
      bodies.push_back({person.at(seconds_of_world), options.people.radius_m, options.people.height_m,
                        1000 + static_cast<int>(&person - people[static_cast<std::size_t>(building)].data())});
    }
    return bodies;
  }
  bool is_carried(std::size_t robot, double seconds_of_robot, double within_s = 0.0) const {
    return std::any_of(carries[robot].begin(), carries[robot].end(), [&](const Carry& carry) {
      return seconds_of_robot + within_s > carry.from_s && seconds_of_robot - within_s < carry.to_s;
    });
  }
};

World::World(WorldOptions options, WorkerPool& pool) {
  auto state = std::make_unique<State>();
  if (options.buildings.empty()) options.buildings.emplace_back();
  check(options);
  check_together(options);
  state->options = std::move(options);
  const WorldOptions& world = state->options;
  const std::uint64_t seed = static_cast<std::uint64_t>(world.seed);
  state->tick_ns =
      std::max<std::int64_t>(1, std::llround(1e6 / (world.laser.scans_per_second * world.odometry.steps_per_scan))) *
      1000;

  std::vector<Point2> origins;
  double next_x = 0.0;
  for (std::size_t i = 0; i < world.buildings.size(); ++i) {
    const BuildingOptions& building = world.buildings[i];
    const std::uint64_t plan_seed =
        building.seed > 0 ? static_cast<std::uint64_t>(building.seed) : RandomStream(seed, "building").at(i).bits();
    FloorPlan plan = make_plan(building, plan_seed);
    origins.push_back({next_x, 0.0});
    next_x += bounds(plan).high_x + kBetweenBuildings;
    state->buildings.push_back(moved(std::move(plan), origins.back().x, origins.back().y));
    state->casters.emplace_back(state->buildings.back().walls);
    state->floors.emplace_back(world.motion.floor_tilt_deg, plan_seed);
    state->plan_seeds.push_back(plan_seed);
  }
  for (const RayCaster& caster : state->casters) state->lasers.emplace_back(caster, world.laser);
  const auto spaces = pool.map(state->buildings.size(),
                               [&](std::size_t i) { return FreeSpace(state->buildings[i], world.motion.clearance_m); });

  state->trajectories = pool.map(world.robots.size(), [&](std::size_t i) {
    const std::size_t building = static_cast<std::size_t>(world.robots[i].building);
    return plan_trajectory(world.robots[i], state->buildings[building], origins[building], spaces[building],
                           world.motion, seed);
  });
  for (std::size_t i = 0; i < world.robots.size(); ++i) {
    state->carries.emplace_back();
    state->trajectories[i] = carried_away(state->trajectories[i], world.robots[i], state->carries.back());
  }
  double end_s = 0.0;
  for (std::size_t i = 0; i < world.robots.size(); ++i) {
    state->first_ticks.push_back(std::llround(world.robots[i].start_s * 1e9 / static_cast<double>(state->tick_ns)));
    end_s = std::max(end_s, state->seconds(state->first_ticks[i]) + state->trajectories[i].duration_s());
  }
  const std::size_t people = static_cast<std::size_t>(world.people.count);
  MotionOptions walk = world.motion;
  walk.speed_min_m_per_s = walk.speed_max_m_per_s = world.people.speed_m_per_s;
  auto walks = pool.map(state->buildings.size() * people, [&](std::size_t i) {
    const std::size_t building = i / people;
    RobotOptions person;
    person.id = "person " + std::to_string(i % people) + " of building " + std::to_string(building);
    person.order = TourOrder::shuffled;
    person.return_to_start = false;
    person.length_m = 0.1 + end_s * world.people.speed_m_per_s;  // to the end, whatever the turns take
    return plan_trajectory(person, state->buildings[building], origins[building], spaces[building], walk, seed);
  });
  state->people.resize(state->buildings.size());
  for (std::size_t i = 0; i < walks.size(); ++i) state->people[i / people].push_back(std::move(walks[i]));
  state->scenes.resize(state->buildings.size());
  state_ = std::move(state);
}

World::~World() = default;
World::World(World&&) noexcept = default;

const WorldOptions& World::options() const { return state_->options; }
const std::vector<FloorPlan>& World::buildings() const { return state_->buildings; }
std::size_t World::robot_count() const { return state_->trajectories.size(); }
RobotId World::robot_id(std::size_t robot) const { return RobotId{state_->options.robots.at(robot).id}; }
std::size_t World::building_of(std::size_t robot) const {
  return static_cast<std::size_t>(state_->options.robots.at(robot).building);
}
const SimulatedTrajectory& World::trajectory(std::size_t robot) const { return state_->trajectories.at(robot); }
std::size_t World::step_count(std::size_t robot) const {
  return static_cast<std::size_t>(trajectory(robot).duration_s() * 1e9 / static_cast<double>(state_->tick_ns)) + 1;
}
std::size_t World::scan_count(std::size_t robot) const {
  return (step_count(robot) - 1) / static_cast<std::size_t>(state_->options.odometry.steps_per_scan) + 1;
}

const std::vector<CameraOptions>& World::cameras(std::size_t robot) const {
  const auto& own = state_->options.robots.at(robot).cameras;
  return own.empty() ? state_->options.cameras : own;
}
const Scene& World::scene(std::size_t building) const {
  State::LazyScene& lazy = state_->scenes.at(building);
  std::call_once(lazy.once, [&] {
    WorkerPool here(1);
    lazy.scene = std::make_unique<const Scene>(state_->buildings[building], state_->options.look,
                                               state_->plan_seeds[building], here);
  });
  return *lazy.scene;
}
Stamp World::first_stamp(std::size_t robot) const {
  return Stamp{kFirstMoment + state_->first_ticks.at(robot) * state_->tick_ns};
}
Pose3 World::world_from_robot(std::size_t robot, double seconds) const {
  return state_->floors[building_of(robot)].on_floor(trajectory(robot).at(seconds));
}
std::vector<Body> World::bodies_around(std::size_t robot, double seconds) const {
  return state_->bodies_around(robot, seconds + state_->seconds(state_->first_ticks.at(robot)));
}
bool World::is_carried(std::size_t robot, double seconds, double within_s) const {
  return state_->is_carried(robot, seconds, within_s);
}

Recording::Recording(const World& world, std::size_t robot)
    : world_(&world),
      robot_(robot),
      odometry_(world.options().odometry, static_cast<std::uint64_t>(world.options().seed),
                world.options().robots.at(robot).id) {}

std::optional<SimulatedStep> Recording::next() {
  if (step_ >= world_->step_count(robot_)) return std::nullopt;
  const World::State& state = *world_->state_;
  const std::int64_t ticks = state.first_ticks[robot_] + static_cast<std::int64_t>(step_);
  SimulatedStep step;
  step.stamp = Stamp{kFirstMoment + ticks * state.tick_ns};
  const double seconds = state.seconds(static_cast<std::int64_t>(step_));
  step.world_from_robot = state.trajectories[robot_].at(seconds);
  const bool is_carried = state.is_carried(robot_, seconds);
  step.odometry_from_robot =
      is_carried ? odometry_.carry(step.world_from_robot) : odometry_.step(step.world_from_robot);
  if (step_ % static_cast<std::size_t>(state.options.odometry.steps_per_scan) == 0) {
    const RandomStream noise(static_cast<std::uint64_t>(state.options.seed), "laser", state.options.robots[robot_].id);
    const LaserSensor& laser = state.lasers[world_->building_of(robot_)];
    std::vector<Disc> moving;
    for (const Body& body : state.bodies_around(robot_, state.seconds(ticks)))
      moving.push_back({{body.world_from_body.x, body.world_from_body.y}, body.radius_m});
    const SimulatedTrajectory& trajectory = state.trajectories[robot_];
    step.ranges = laser.options().sweep_s > 0.0
                      ? laser.swept_scan([&](double after_s) { return trajectory.at(seconds + after_s); }, moving,
                                         noise.at(step_))
                      : laser.scan(step.world_from_robot, moving, noise.at(step_));
    if (is_carried) std::fill(step.ranges.begin(), step.ranges.end(), 0.0f);  // its laser is covered
  }
  ++step_;
  return step;
}

}  // namespace mapweave::simulation
