#include "self_repetition.h"

#include "seen_raster.h"

#include <algorithm>
#include <array>
#include <cmath>

namespace mapweave::fusion {
namespace {

using matching::cell_of;
using matching::WallPoint;

constexpr double kCell_m = SeenRaster::kCell_m, kStep_m = 2.0 * kCell_m;  // of walls; of the first look
constexpr double kLargestPart_m = 300.0, kReach_m = 40.0;  // around the part
constexpr double kElsewhere_m = 3.0;                // from the middle of the part, at least
constexpr double kShare = 0.32, kRoom_m = 20.0;     // of a part that stands twice
// What is contradicted elsewhere may be that share of what coincides there, or that of the place itself.
constexpr double kContradictionWeight = 4.0, kLeastDoubt = 0.25, kMostDoubt = 0.4, kAsDoubtful = 1.5;
constexpr double kAcross = 0.1;                     // share of walls of the rarer direction: lines fit anywhere along themselves
constexpr std::size_t kFirstLook = 64, kSecondLook = 400, kMostPlaces = 64;

std::vector<WallPoint> some_of(const std::vector<WallPoint>& walls, std::size_t most) {
  std::vector<WallPoint> some;
  const std::size_t count = std::min(most, walls.size());
  for (std::size_t i = 0; i < count; ++i) some.push_back(walls[i * walls.size() / count]);
  return some;
}

// A motion of the team's plane: a turn by quarters about a middle, then a shift.
struct Motion {
  double middle_x, middle_y;
  int quarters;
  double shift_x, shift_y;
  std::pair<double, double> moved(double x, double y) const {
    const auto [u, v] = turned(x - middle_x, y - middle_y, quarters);
    return {middle_x + u + shift_x, middle_y + v + shift_y};
  }
  std::pair<double, double> back(double x, double y) const {
    const auto [u, v] = turned(x - middle_x - shift_x, y - middle_y - shift_y, 4 - quarters);
    return {middle_x + u, middle_y + v};
  }
  static std::pair<double, double> turned(double x, double y, int quarters) {
    switch (quarters % 4) {
      case 1: return {-y, x};
      case 2: return {-x, -y};
      case 3: return {y, -x};
      default: return {x, y};
    }
  }
};

// The part of a guest that a host knows, and how it lies on the host.
class Part {
 public:
  Part(const std::vector<WallPoint>& guest_walls, const SeenRaster& guest, const std::vector<WallPoint>& host_walls, const SeenRaster& host)
      : guest_(guest), host_(host), host_walls_(host_walls) {
    double cosine = 0.0, sine = 0.0;
    for (const WallPoint& wall : guest_walls) {
      if (host.at(wall.x, wall.y) == Seen::not_at_all) continue;
      walls_.push_back(wall);
      middle_x_ += wall.x, middle_y_ += wall.y;
      const double angle = 4.0 * std::atan2(wall.normal_y, wall.normal_x);
      cosine += std::cos(angle), sine += std::sin(angle);
      box_.add(wall.x, wall.y, 0.0);
    }
    middle_x_ /= static_cast<double>(std::max<std::size_t>(1, walls_.size()));
    middle_y_ /= static_cast<double>(std::max<std::size_t>(1, walls_.size()));
    const double direction = 0.25 * std::atan2(sine, cosine);
    for (const WallPoint& wall : walls_) faces_.push_back(std::cos(2.0 * (std::atan2(wall.normal_y, wall.normal_x) - direction)) > 0.0 ? 0 : 1);
    here_ = look({middle_x_, middle_y_, 0, 0.0, 0.0}, walls_.size(), 0.0);
  }

  double shared_m() const { return here_.coinciding_m; }
  const PlaneBox& box() const { return box_; }

  // Walls that coincide elsewhere on the host, at most.
  double repeated_m(const matching::Raster<char>& host_about, const PlaneBox& host_box) const {
    const std::vector<WallPoint> few = some_of(walls_, kFirstLook);
    const double least_m = std::max(kRoom_m, kShare * here_.coinciding_m);
    const double doubt = std::clamp(kAsDoubtful * here_.doubt(), kLeastDoubt, kMostDoubt);
    std::vector<std::pair<std::size_t, Motion>> places;
    for (int quarters = 0; quarters < 4; ++quarters) {
      std::vector<std::pair<double, double>> about;
      for (const WallPoint& wall : few) about.push_back(Motion::turned(wall.x - middle_x_, wall.y - middle_y_, quarters));
      for (double y = host_box.y0_m; y <= host_box.y1_m; y += kStep_m)
        for (double x = host_box.x0_m; x <= host_box.x1_m; x += kStep_m) {
          if (std::hypot(x - middle_x_, y - middle_y_) < kElsewhere_m) continue;
          const std::size_t hits = hits_at(about, x, y, host_about, least_m / (kCell_m * static_cast<double>(walls_.size())));
          if (hits > 0) places.emplace_back(hits, Motion{middle_x_, middle_y_, quarters, x - middle_x_, y - middle_y_});
        }
    }
    std::stable_sort(places.begin(), places.end(), [](const auto& l, const auto& r) { return l.first > r.first; });
    std::vector<Motion> looked;
    double most_m = 0.0;
    for (const auto& [hits, place] : places) {
      const auto is_near = [place = place](const Motion& other) {
        return other.quarters == place.quarters && std::hypot(other.shift_x - place.shift_x, other.shift_y - place.shift_y) < 0.5;
      };
      if (std::any_of(looked.begin(), looked.end(), is_near)) continue;
      looked.push_back(place);
      for (int j = -2; j <= 2; ++j)
        for (int i = -2; i <= 2; ++i) {
          Motion near = place;
          near.shift_x += i * kCell_m, near.shift_y += j * kCell_m;
          const Look there = look(near, kSecondLook, std::max(least_m, most_m));
          if (there.coinciding_m >= least_m && there.coinciding_m > most_m && there.is_of_two_directions() && there.doubt() <= doubt) most_m = there.coinciding_m;
        }
      if (looked.size() == kMostPlaces) break;
    }
    return most_m;
  }

 private:
  struct Look {
    double coinciding_m = 0.0, contradicted_m = 0.0;
    std::array<double, 2> by_direction_m{0.0, 0.0};  // of what coincides
    double doubt() const { return kContradictionWeight * contradicted_m / std::max(kCell_m, coinciding_m); }
    bool is_of_two_directions() const { return std::min(by_direction_m[0], by_direction_m[1]) >= kAcross * coinciding_m; }
  };

  // Hits of the first look; 0 where too few are possible.
  std::size_t hits_at(const std::vector<std::pair<double, double>>& about, double x, double y, const matching::Raster<char>& host_about,
                      double share) const {
    const auto needed = static_cast<std::size_t>(0.75 * share * static_cast<double>(about.size()));
    std::size_t hits = 0;
    for (std::size_t k = 0; k < about.size(); ++k) {
      hits += host_about.get(cell_of(x + about[k].first, 1.0 / kStep_m), cell_of(y + about[k].second, 1.0 / kStep_m)) != 0;
      if (hits + about.size() - k - 1 < needed) return 0;
    }
    return hits;
  }

  // By some of the walls; contradictions are looked for where at least so much coincides.
  Look look(const Motion& motion, std::size_t most_walls, double least_m) const {
    Look result;
    const std::size_t count = std::min(most_walls, walls_.size());
    const double each_m = kCell_m * static_cast<double>(walls_.size()) / static_cast<double>(std::max<std::size_t>(1, count));
    for (std::size_t k = 0; k < count; ++k) {
      const std::size_t i = k * walls_.size() / count;
      const auto [x, y] = motion.moved(walls_[i].x, walls_[i].y);
      const Seen seen = host_.at(x, y);
      if (seen == Seen::wall) {
        result.coinciding_m += each_m;
        result.by_direction_m[faces_[i]] += each_m;
      } else if (seen == Seen::through) {
        result.contradicted_m += each_m;
      }
    }
    if (result.coinciding_m < least_m) return result;
    // Walls of the host where the part has none.
    for (const WallPoint& wall : host_walls_) {
      const auto [x, y] = motion.back(wall.x, wall.y);
      if (box_.has(x, y) && guest_.at(x, y) == Seen::through && host_.at(x, y) != Seen::not_at_all) result.contradicted_m += kCell_m;
    }
    return result;
  }

  const SeenRaster &guest_, &host_;
  const std::vector<WallPoint>& host_walls_;
  std::vector<WallPoint> walls_;
  std::vector<std::uint8_t> faces_;  // of each wall: which of the two directions it faces
  double middle_x_ = 0.0, middle_y_ = 0.0;
  PlaneBox box_;
  Look here_;
};

}  // namespace

Repetition self_repetition(const std::vector<PlacedSubmap>& a, const std::vector<PlacedSubmap>& b, const SightOf& sight_of) {
  Repetition most;
  const PlaneBox in_a = box_of(a), in_b = box_of(b), common = in_a.within(in_b);
  if (common.empty()) return most;
  const std::array<PlaneBox, 2> boxes{in_a.within(common.grown(kReach_m)), in_b.within(common.grown(kReach_m))};
  const std::array<SeenRaster, 2> rasters{SeenRaster(a, boxes[0], sight_of), SeenRaster(b, boxes[1], sight_of)};
  const std::array<std::vector<WallPoint>, 2> walls{walls_in(a, boxes[0]), walls_in(b, boxes[1])};
  for (std::size_t host = 0; host < 2; ++host) {
    const std::size_t guest = 1 - host;
    const Part part(walls[guest], rasters[guest], walls[host], rasters[host]);
    if (part.shared_m() < kRoom_m || part.shared_m() > kLargestPart_m) continue;
    const PlaneBox& box = boxes[host];
    const Repetition found{part.shared_m(), part.repeated_m(rasters[host].walls_about(), box)};
    if (found.repeated_m * std::max(kCell_m, most.shared_m) > most.repeated_m * found.shared_m) most = found;
  }
  return most;
}

bool repeats(const Repetition& repetition) {
  return repetition.repeated_m >= kRoom_m && repetition.repeated_m >= kShare * repetition.shared_m;
}

}  // namespace mapweave::fusion
