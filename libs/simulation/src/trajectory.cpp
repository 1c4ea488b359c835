#include <mapweave/simulation/trajectory.h>

#include <mapweave/core/error.h>

#include <algorithm>
#include <cmath>

namespace mapweave::simulation {
namespace {

constexpr double kLongestCut = 0.6;                     // of a corner, along either side, metres
constexpr double kSharpestRadius = 0.08;                // sharper corners are turned on the spot, metres
constexpr double kArcStep = 0.02, kStraightStep = 0.1;  // metres
constexpr double kTurnStep = 0.5;  // radians: turns on the spot are even, so that few knots say it all

double distance(Point2 a, Point2 b) { return std::hypot(b.x - a.x, b.y - a.y); }

// The path before time: poses in order; `speed` is what the path up to here allows; a pose at the place of the one
// before is a turn on the spot.
struct Station {
  Pose2 pose;
  double path_m;  // since the start
  double speed;
};

class Course {
 public:
  Course(const FreeSpace& space, const MotionOptions& motion) : space_(space), motion_(motion) {}

  std::vector<Station> follow(const std::vector<Leg>& legs) {
    std::vector<Point2> points;
    std::vector<double> speeds;  // of the path to each point
    for (const Leg& leg : legs) {
      for (const Point2 p : leg.path) {
        if (!points.empty() && distance(points.back(), p) < 1e-6) continue;
        points.push_back(p);
        speeds.push_back(leg.speed_m_per_s);
      }
    }
    MAPWEAVE_EXPECT(!points.empty(), "a drive has a start");
    const auto heading = [&](std::size_t i) {
      return std::atan2(points[i + 1].y - points[i].y, points[i + 1].x - points[i].x);
    };
    stations_.push_back({{points[0].x, points[0].y, points.size() > 1 ? heading(0) : 0.0}, 0.0, 0.0});
    for (std::size_t i = 1; i < points.size(); ++i) {
      if (i + 1 == points.size()) {
        go_straight(points[i], speeds[i]);
        break;
      }
      const double turn = wrap_angle(heading(i) - heading(i - 1));
      const double cut = longest_cut(points[i - 1], points[i], points[i + 1], heading(i - 1), turn);
      const Point2 arc_start{points[i].x - cut * std::cos(heading(i - 1)),
                             points[i].y - cut * std::sin(heading(i - 1))};
      go_straight(arc_start, speeds[i]);
      if (cut > 0.0) {
        go_round(turn, cut / std::tan(0.5 * std::abs(turn)), std::min(speeds[i], speeds[i + 1]));
      } else {
        turn_on_the_spot(turn);
      }
      stations_.back().pose.phi = wrap_angle(heading(i));
    }
    return std::move(stations_);
  }

 private:
  // How far before the corner the arc may begin; 0: no arc keeps the clearance, or the corner is none.
  double longest_cut(Point2 before, Point2 corner, Point2 after, double heading_in, double turn) const {
    if (std::abs(turn) < 1e-6) return 0.0;
    for (double cut = std::min({kLongestCut, 0.5 * distance(before, corner), 0.5 * distance(corner, after)});;
         cut *= 0.5) {
      const double radius = cut / std::tan(0.5 * std::abs(turn));
      if (radius < kSharpestRadius) return 0.0;
      const Pose2 start{corner.x - cut * std::cos(heading_in), corner.y - cut * std::sin(heading_in), heading_in};
      const int steps = static_cast<int>(std::ceil(radius * std::abs(turn) / kArcStep));
      bool is_free = true;
      for (int i = 0; i <= steps && is_free; ++i) {
        const Pose2 pose = on_arc(start, turn * i / steps, radius);
        is_free = space_.distance_to_walls({pose.x, pose.y}) >= space_.clearance_m();
      }
      if (is_free) return cut;
    }
  }

  static Pose2 on_arc(const Pose2& start, double turn, double radius) {
    const double side = turn < 0.0 ? -radius : radius;
    return compose(start, {side * std::sin(turn), side * (1.0 - std::cos(turn)), turn});
  }

  void go_straight(Point2 to, double speed) {
    const Station start = stations_.back();
    const double length = distance({start.pose.x, start.pose.y}, to);
    if (length < 1e-9) return;
    const int steps = static_cast<int>(std::ceil(length / kStraightStep));
    for (int i = 1; i <= steps; ++i) {
      const double t = static_cast<double>(i) / steps;
      stations_.push_back(
          {{start.pose.x + t * (to.x - start.pose.x), start.pose.y + t * (to.y - start.pose.y), start.pose.phi},
           start.path_m + t * length,
           speed});
    }
  }

  void go_round(double turn, double radius, double speed) {
    const Station start = stations_.back();
    const double slow = std::min(speed, radius * motion_.turn_rate_deg_per_s * (M_PI / 180.0));
    const int steps = static_cast<int>(std::ceil(radius * std::abs(turn) / kArcStep));
    const double chord = 2.0 * radius * std::sin(0.5 * std::abs(turn) / steps);
    for (int i = 1; i <= steps; ++i) {
      stations_.push_back({on_arc(start.pose, turn * i / steps, radius), start.path_m + i * chord, slow});
    }
  }

  void turn_on_the_spot(double turn) {
    const Station start = stations_.back();
    const int steps = static_cast<int>(std::ceil(std::abs(turn) / kTurnStep));
    for (int i = 1; i <= steps; ++i) {
      stations_.push_back(
          {{start.pose.x, start.pose.y, wrap_angle(start.pose.phi + turn * i / steps)}, start.path_m, 0.0});
    }
  }

  const FreeSpace& space_;
  const MotionOptions& motion_;
  std::vector<Station> stations_;
};

void cut_at(std::vector<Station>& stations, double length_m) {
  const auto after = std::find_if(stations.begin(), stations.end(),
                                  [&](const Station& station) { return station.path_m >= length_m; });
  if (after == stations.end() || after == stations.begin()) return;
  const Station& last = *std::prev(after);
  const double t = (length_m - last.path_m) / (after->path_m - last.path_m);
  after->pose = {last.pose.x + t * (after->pose.x - last.pose.x), last.pose.y + t * (after->pose.y - last.pose.y),
                 wrap_angle(last.pose.phi + t * wrap_angle(after->pose.phi - last.pose.phi))};
  after->path_m = length_m;
  stations.erase(std::next(after), stations.end());
}

}  // namespace

SimulatedTrajectory::SimulatedTrajectory(std::vector<Knot> knots) : knots_(std::move(knots)) {
  MAPWEAVE_EXPECT(!knots_.empty(), "a trajectory has a start");
}

Pose2 SimulatedTrajectory::at(double seconds) const {
  const auto after = std::upper_bound(knots_.begin(), knots_.end(), seconds,
                                      [](double value, const Knot& knot) { return value < knot.seconds; });
  if (after == knots_.begin()) return knots_.front().world_from_robot;
  if (after == knots_.end()) return knots_.back().world_from_robot;
  const Knot& before = *std::prev(after);
  const double elapsed = (seconds - before.seconds) / (after->seconds - before.seconds);
  const double speeds = before.speed_m_per_s + after->speed_m_per_s;
  const double t =
      speeds > 0.0
          ? elapsed * (2.0 * before.speed_m_per_s + (after->speed_m_per_s - before.speed_m_per_s) * elapsed) / speeds
          : elapsed;
  const Pose2& a = before.world_from_robot;
  const Pose2& b = after->world_from_robot;
  return {a.x + t * (b.x - a.x), a.y + t * (b.y - a.y), wrap_angle(a.phi + t * wrap_angle(b.phi - a.phi))};
}

double SimulatedTrajectory::length_m() const {
  double length = 0.0;
  for (std::size_t i = 1; i < knots_.size(); ++i) {
    const Pose2& a = knots_[i - 1].world_from_robot;
    const Pose2& b = knots_[i].world_from_robot;
    length += std::hypot(b.x - a.x, b.y - a.y);
  }
  return length;
}

SimulatedTrajectory drive(const std::vector<Leg>& legs, const FreeSpace& space, const MotionOptions& motion,
                          double length_m) {
  std::vector<Station> stations = Course(space, motion).follow(legs);
  if (length_m > 0.0) cut_at(stations, length_m);

  // Speeds at the stations: what the path before and after each allows, then speeding up, then braking.
  const std::size_t count = stations.size();
  std::vector<double> speeds(count, 0.0);
  for (std::size_t i = 1; i + 1 < count; ++i) speeds[i] = std::min(stations[i].speed, stations[i + 1].speed);
  const auto limit = [&](double speed, std::size_t i) {
    return std::sqrt(speed * speed +
                     2.0 * motion.acceleration_m_per_s2 * (stations[i].path_m - stations[i - 1].path_m));
  };
  for (std::size_t i = 1; i < count; ++i) speeds[i] = std::min(speeds[i], limit(speeds[i - 1], i));
  for (std::size_t i = count - 1; i > 0; --i) speeds[i - 1] = std::min(speeds[i - 1], limit(speeds[i], i));

  std::vector<SimulatedTrajectory::Knot> knots{{0.0, stations[0].pose, 0.0}};
  for (std::size_t i = 1; i < count; ++i) {
    const double path = stations[i].path_m - stations[i - 1].path_m;
    double seconds;
    if (path <= 0.0) {
      seconds = std::abs(wrap_angle(stations[i].pose.phi - stations[i - 1].pose.phi)) /
                (motion.turn_rate_deg_per_s * (M_PI / 180.0));
    } else if (speeds[i - 1] + speeds[i] > 0.0) {
      seconds = 2.0 * path / (speeds[i - 1] + speeds[i]);
    } else {  // from rest to rest within one step
      seconds = std::max(2.0 * std::sqrt(path / motion.acceleration_m_per_s2), path / stations[i].speed);
    }
    if (seconds > 0.0) knots.push_back({knots.back().seconds + seconds, stations[i].pose, speeds[i]});
  }
  return SimulatedTrajectory(std::move(knots));
}

}  // namespace mapweave::simulation
