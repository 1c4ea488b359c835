#include "self_repetition.h"

#include "seen_raster.h"

#include <mapweave/fusion/wall_weights.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstring>

namespace mapweave::fusion {
namespace {

using matching::cell_of;
using matching::WallPoint;

constexpr double kCell_m = SeenRaster::kCell_m, kStep_m = 2.0 * kCell_m;  // of walls; of the first look
constexpr double kReach_m = 40.0;                                         // around the part
constexpr double kElsewhere_m = 3.0;                                      // from the middle of the part, at least
// Of a part that stands twice: a third of it and a room's walls. Right merges of public logs have no such place,
// simulated rooms 18 m at most (DECISIONS.md, 66).
constexpr double kShare = 0.32, kRoom_m = 20.0;
// Of a part of many rooms: a corridor of 300 m of walls stands twice by 0.65 where it is rightly joined, five aisles of
// a warehouse by 0.75.
constexpr double kManyRooms_m = 300.0, kShareOfManyRooms = 0.7;
// What is contradicted elsewhere, as a share of what coincides there, may be half as much again as at the place itself:
// a quarter at least, the bound that parts of a team have, and two fifths at most.
constexpr double kLeastDoubt = 0.25, kMostDoubt = 0.4, kAsDoubtful = 1.5;
constexpr double kAcross = 0.1;  // share of walls of the rarer direction: lines fit anywhere along themselves
// Walls of the part that are looked at in each cell, and where these fit; places that are looked at again, and those
// that are kept, as many as are asked what the whole maps say of them (DECISIONS.md, 72): all bound the time.
constexpr std::size_t kFirstLook = 64, kSecondLook = 400, kMostPlaces = 64, kMostRepetitions = 8;

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
  Pose2 pose() const {
    const auto [x, y] = moved(0.0, 0.0);
    return {x, y, wrap_angle(0.5 * M_PI * quarters)};
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

// For each of `columns` cells from (x, y) rightwards: how many of the places, which are cells relative to it, hold a
// wall.
void count_hits(const std::vector<std::pair<int, int>>& places, int x, int y, const matching::Raster<char>& walls,
                std::vector<char>& hits) {
  static_assert(kFirstLook < 128, "they are counted in a byte");
  std::fill(hits.begin(), hits.end(), char{0});
  const int columns = static_cast<int>(hits.size());
  for (const auto& [right, up] : places) {
    const int row = y + up, first = std::max(x + right, walls.first_x()),
              end = std::min(x + right + columns, walls.first_x() + walls.width());
    if (first >= end || row < walls.first_y() || row >= walls.first_y() + walls.height()) continue;
    const char* wall = walls.row(first, row);
    char* hit = hits.data() + (first - x - right);
    int k = 0;
    for (constexpr int kLane = sizeof(std::uint64_t); k + kLane <= end - first; k += kLane) {
      std::uint64_t sums = 0, ones = 0;  // of a byte each, which none outgrows
      std::memcpy(&sums, hit + k, kLane);
      std::memcpy(&ones, wall + k, kLane);
      sums += ones;
      std::memcpy(hit + k, &sums, kLane);
    }
    for (; k < end - first; ++k) hit[k] = static_cast<char>(hit[k] + wall[k]);
  }
}

// The part of a guest that a host knows, and how it lies on the host.
class Part {
 public:
  Part(const std::vector<WallPoint>& guest_walls, const SeenRaster& guest, const std::vector<WallPoint>& host_walls,
       const SeenRaster& host)
      : guest_(guest), host_(host), host_walls_(host_walls) {
    double cosine = 0.0, sine = 0.0;
    for (const WallPoint& wall : guest_walls) {
      if (host.at(wall.x, wall.y) == Seen::not_at_all) continue;
      walls_.push_back(wall);
      middle_x_ += wall.x;
      middle_y_ += wall.y;
      const double angle = 4.0 * std::atan2(wall.normal_y, wall.normal_x);
      cosine += std::cos(angle);
      sine += std::sin(angle);
      box_.add(wall.x, wall.y, 0.0);
    }
    middle_x_ /= static_cast<double>(std::max<std::size_t>(1, walls_.size()));
    middle_y_ /= static_cast<double>(std::max<std::size_t>(1, walls_.size()));
    const double direction = 0.25 * std::atan2(sine, cosine);
    for (const WallPoint& wall : walls_)
      faces_.push_back(std::cos(2.0 * (std::atan2(wall.normal_y, wall.normal_x) - direction)) > 0.0 ? 0 : 1);
    const Motion here{middle_x_, middle_y_, 0, 0.0, 0.0};
    here_ = look(placed(here, walls_.size()), 0, 0);
    if (shared_m() >= kRoom_m) here_.contradicted_m += missing_m(here, 1e300);
  }

  double shared_m() const { return here_.coinciding_m; }

  // Places elsewhere on the host where enough of the part coincides: walls that do, and how the part is moved.
  std::vector<std::pair<double, Pose2>> places_elsewhere(const matching::Raster<char>& host_about,
                                                         const PlaneBox& host_box) const {
    const double least_m = std::max(kRoom_m, kShare * here_.coinciding_m);
    const double doubt = std::clamp(kAsDoubtful * here_.doubt(), kLeastDoubt, kMostDoubt);
    std::vector<Motion> looked;
    std::vector<std::pair<double, Pose2>> result;
    for (const Likely& likely : likely_places(host_about, host_box, least_m)) {
      const Motion place{middle_x_, middle_y_, likely.quarters, likely.shift_x, likely.shift_y};
      const auto is_near = [&](const Motion& other) {
        return other.quarters == place.quarters &&
               std::hypot(other.shift_x - place.shift_x, other.shift_y - place.shift_y) < 0.5;
      };
      if (std::any_of(looked.begin(), looked.end(), is_near)) continue;
      looked.push_back(place);
      const std::vector<Placed> walls = placed(place, kSecondLook);
      double most_m = 0.0;
      Motion best = place;
      for (int j = -2; j <= 2; ++j)
        for (int i = -2; i <= 2; ++i) {
          Look there = look(walls, i, j);
          if (there.coinciding_m < least_m || there.coinciding_m <= most_m || !there.is_of_two_directions() ||
              there.doubt() > doubt)
            continue;
          Motion near = place;
          near.shift_x += i * kCell_m;
          near.shift_y += j * kCell_m;
          there.contradicted_m +=
              missing_m(near, doubt * there.coinciding_m / kContradictionWeight - there.contradicted_m);
          if (there.doubt() > doubt) continue;
          most_m = there.coinciding_m;
          best = near;
        }
      if (most_m > 0.0) result.emplace_back(most_m, best.pose());
      if (looked.size() == kMostPlaces) break;
    }
    return result;
  }

 private:
  struct Look {
    double coinciding_m = 0.0, contradicted_m = 0.0;
    std::array<double, 2> by_direction_m{0.0, 0.0};  // of what coincides
    double doubt() const { return kContradictionWeight * contradicted_m / std::max(kCell_m, coinciding_m); }
    bool is_of_two_directions() const {
      return std::min(by_direction_m[0], by_direction_m[1]) >= kAcross * coinciding_m;
    }
  };
  struct Likely {
    int hits, quarters;
    double shift_x, shift_y;
  };
  struct Placed {
    int x, y;  // cell
    std::uint8_t face;
  };

  // Where some of the walls may coincide, most of them first.
  std::vector<Likely> likely_places(const matching::Raster<char>& host_about, const PlaneBox& host_box,
                                    double least_m) const {
    const std::vector<WallPoint> few = some_of(walls_, kFirstLook);
    const double share = least_m / (kCell_m * static_cast<double>(walls_.size()));
    const auto needed = std::max(1, static_cast<int>(0.75 * share * static_cast<double>(few.size())));
    const auto steps = [](double from, double to) { return static_cast<int>((to - from) / kStep_m) + 1; };
    const int columns = steps(host_box.x0_m, host_box.x1_m), rows = steps(host_box.y0_m, host_box.y1_m);
    std::vector<char> hits(static_cast<std::size_t>(columns));
    std::vector<Likely> places;
    for (int quarters = 0; quarters < 4; ++quarters) {
      std::vector<std::pair<int, int>> about;
      for (const WallPoint& wall : few) {
        const auto [u, v] = Motion::turned(wall.x - middle_x_, wall.y - middle_y_, quarters);
        about.emplace_back(cell_of(host_box.x0_m + u, 1.0 / kStep_m), cell_of(host_box.y0_m + v, 1.0 / kStep_m));
      }
      for (int j = 0; j < rows; ++j) {
        count_hits(about, 0, j, host_about, hits);
        for (int i = 0; i < columns; ++i) {
          if (hits[static_cast<std::size_t>(i)] < needed) continue;
          const double shift_x = host_box.x0_m + i * kStep_m - middle_x_,
                       shift_y = host_box.y0_m + j * kStep_m - middle_y_;
          if (std::hypot(shift_x, shift_y) < kElsewhere_m) continue;
          places.push_back({hits[static_cast<std::size_t>(i)], quarters, shift_x, shift_y});
        }
      }
    }
    std::stable_sort(places.begin(), places.end(), [](const Likely& l, const Likely& r) { return l.hits > r.hits; });
    return places;
  }

  // Some of the walls, as they lie then.
  std::vector<Placed> placed(const Motion& motion, std::size_t most_walls) const {
    std::vector<Placed> result;
    const std::size_t count = std::min(most_walls, walls_.size());
    for (std::size_t k = 0; k < count; ++k) {
      const std::size_t i = k * walls_.size() / count;
      const auto [x, y] = motion.moved(walls_[i].x, walls_[i].y);
      result.push_back({cell_of(x, 1.0 / kCell_m), cell_of(y, 1.0 / kCell_m), faces_[i]});
    }
    return result;
  }

  // What the host has there, shifted by so many cells.
  Look look(const std::vector<Placed>& walls, int right, int up) const {
    std::array<int, 2> hits{0, 0};
    int through = 0;
    for (const Placed& wall : walls) {
      const Seen seen = host_.at_cell(wall.x + right, wall.y + up);
      hits[wall.face] += seen == Seen::wall ? 1 : 0;
      through += seen == Seen::through ? 1 : 0;
    }
    const double each_m =
        kCell_m * static_cast<double>(walls_.size()) / static_cast<double>(std::max<std::size_t>(1, walls.size()));
    return {each_m * (hits[0] + hits[1]), each_m * through, {each_m * hits[0], each_m * hits[1]}};
  }

  // Walls of the host where the part, laid there, has none; no more are counted once they are more than `most_m`.
  double missing_m(const Motion& motion, double most_m) const {
    double result = 0.0;
    for (const WallPoint& wall : host_walls_) {
      const auto [x, y] = motion.back(wall.x, wall.y);
      if (!box_.has(x, y) || guest_.at(x, y) != Seen::through || host_.at(x, y) == Seen::not_at_all) continue;
      result += kCell_m;
      if (result > most_m) break;
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

std::vector<Repetition> self_repetitions(const std::vector<PlacedSubmap>& a, const std::vector<PlacedSubmap>& b,
                                         const SightOf& sight_of) {
  std::vector<Repetition> result;
  const PlaneBox in_a = box_of(a), in_b = box_of(b), common = in_a.within(in_b);
  if (common.empty()) return result;
  const std::array<PlaneBox, 2> boxes{in_a.within(common.grown(kReach_m)), in_b.within(common.grown(kReach_m))};
  const std::array<SeenRaster, 2> rasters{SeenRaster(a, boxes[0], sight_of), SeenRaster(b, boxes[1], sight_of)};
  const std::array<std::vector<WallPoint>, 2> walls{walls_in(a, boxes[0]), walls_in(b, boxes[1])};
  for (std::size_t host = 0; host < 2; ++host) {
    const std::size_t guest = 1 - host;
    const Part part(walls[guest], rasters[guest], walls[host], rasters[host]);
    if (part.shared_m() < kRoom_m) continue;
    const double share = part.shared_m() > kManyRooms_m ? kShareOfManyRooms : kShare;
    for (const auto& [repeated_m, moved] : part.places_elsewhere(rasters[host].walls_about(), boxes[host]))
      if (repeated_m >= std::max(kRoom_m, share * part.shared_m()))
        result.push_back({part.shared_m(), repeated_m, guest == 0 ? inverse(moved) : moved});
  }
  std::stable_sort(result.begin(), result.end(), [](const Repetition& l, const Repetition& r) {
    return l.repeated_m * r.shared_m > r.repeated_m * l.shared_m;
  });
  if (result.size() > kMostRepetitions) result.resize(kMostRepetitions);
  return result;
}

bool is_contradicted(const WallAgreement& elsewhere, const WallAgreement& here) {
  const auto doubt = [](const WallAgreement& walls) {
    return kContradictionWeight * walls.contradicted_m / std::max(kCell_m, walls.coinciding_m);
  };
  return doubt(elsewhere) > std::clamp(kAsDoubtful * doubt(here), kLeastDoubt, kMostDoubt);
}

}  // namespace mapweave::fusion
