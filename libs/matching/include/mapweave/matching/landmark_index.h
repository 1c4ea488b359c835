#pragma once
// Which landmarks may a camera see? A hash table over the cells of a grid in the map's x-y plane, in which landmarks of
// robots on the ground spread most (CVS III-C, figure 2). All cells that the frustum's outline touches are looked into
// (CVS: those whose middle lies within it, which loses some at its border), then every landmark there is projected.

#include <mapweave/core/geometry.h>
#include <mapweave/core/pinhole.h>
#include <mapweave/maps/exchange.h>
#include <mapweave/matching/orb_descriptor.h>

#include <map>
#include <optional>
#include <unordered_map>
#include <vector>

namespace mapweave::matching {

using mapweave::DescribedLandmark;
// What is wrong with it; empty for one that can be indexed: finite, within kMostCoordinate_m, direction unit or zero,
// sigma positive.
std::string problem_with(const DescribedLandmark&);
inline constexpr double kMostCoordinate_m = 1e6;
// The same in another map's frame, whose scale is `scale` times as large.
DescribedLandmark transformed(const DescribedLandmark&, const Sim3& other_from_map);

struct Frustum {
  Pinhole pinhole;
  Pose3 map_from_camera;              // optical: x right, y down, z forward
  double near_m = 0.2, far_m = 10.0;  // along the optical axis
};

struct RetrievalOptions {
  double margin_px = 10.0;
  double most_turn_rad = 1.0;
  double most_range_ratio = 2.0;
  int most = 400;
  template <class Visitor>
  void describe(Visitor& v) {
    v.number("margin_px", margin_px, 0.0, 1000.0,
             "width in pixels of the border around the picture within which a projected landmark still counts as in "
             "view; larger values share more landmarks");
    v.positive("most_turn_rad", most_turn_rad,
               "largest angle in radians between the direction from which a landmark was seen and the one from which "
               "it would be seen now; larger values share more landmarks, which look more different");
    v.number("most_range_ratio", most_range_ratio, 1.0, 100.0,
             "largest factor between the distance at which a landmark was seen and its distance now; larger values "
             "share more landmarks, which look more different");
    v.integer("most", most, 1, 1000000,
              "most landmarks that are shared with one camera at a time: those that were seen from the most similar "
              "viewpoints; larger values send more bytes");
  }
};

struct LandmarkIndexOptions {
  double cell_m = 1.0;
  bool spatial = false;
  template <class Visitor>
  void describe(Visitor& v) {
    v.number("cell_m", cell_m, 0.05, 1000.0,
             "side in metres of the cells in which landmarks are looked up; affects speed, not what is found; larger "
             "cells are fewer and take longer to look through");
    v.flag("spatial", spatial,
           "divide space by height too, in steps of cell_m, for buildings with many floors; false: each cell reaches "
           "from the ground to "
           "the sky. Affects speed, not what is found");
  }
};

// Not thread-safe while it changes; const calls are. Results do not depend on the order in which landmarks came, moved
// or went.
class LandmarkIndex {
 public:
  explicit LandmarkIndex(LandmarkIndexOptions options = {});

  // New, or in place of the one known by its id, wherever that was. Throws Error(kBadInput) that names the problem.
  void set(const DescribedLandmark&);
  bool remove(const LandmarkId&);  // whether it was there
  void clear();
  const DescribedLandmark* find(const LandmarkId&) const;
  std::size_t size() const { return slots_.size(); }

  // Those in front of the camera, within its picture and distances, and seen before from about there; without those
  // that `asking` updated last; the `most` best, ascending by id. Throws Error(kBadInput) for a frustum that is none:
  // numbers that are not finite, near not within 0..far, a pose that is none, beyond kMostCoordinate_m.
  std::vector<DescribedLandmark> retrieve(const Frustum&, const RetrievalOptions& = {},
                                          const std::optional<ClientId>& asking = {}) const;
  // The same without copies: what there is, by number, until the index changes.
  struct Seen {
    const Eigen::Vector3d* point_in_map;
    std::uint32_t session, index;  // of its id; the session by its number
    std::uint32_t slot;
  };
  std::vector<Seen> look(const Frustum&, const RetrievalOptions& = {},
                         const std::optional<ClientId>& asking = {}) const;
  const DescribedLandmark& landmark(const Seen& seen) const { return landmarks_[seen.slot]; }
  const std::vector<SessionId>& sessions() const { return session_of_number_; }

 private:
  struct Cell {
    std::int32_t x, y, z;
    bool operator==(const Cell& other) const { return x == other.x && y == other.y && z == other.z; }
  };
  struct CellHash {
    std::size_t operator()(const Cell&) const;
  };
  struct IdHash {
    std::size_t operator()(const LandmarkId&) const;
  };
  struct Member {  // what the check looks at next; small, since hundreds are looked at
    Eigen::Vector3f direction;
    float nearest_m, farthest_m;
    std::uint32_t updated_by, slot, session, index;  // clients and sessions: in the order of arrival
  };
  struct Members {                        // as many of both
    std::vector<Eigen::Vector3d> points;  // what it looks at first
    std::vector<Member> members;
  };
  struct Found {
    double merit;
    std::uint64_t order;  // as ids are
    const Eigen::Vector3d* point;
    const Member* member;
  };
  class View;
  Cell cell_of(const Eigen::Vector3d& point) const;
  void take_out(std::uint32_t slot);

  LandmarkIndexOptions options_;
  std::unordered_map<LandmarkId, std::uint32_t, IdHash> slots_;
  std::vector<DescribedLandmark> landmarks_;  // by slot
  std::vector<std::uint32_t> place_in_cell_, free_slots_;
  std::map<SessionId, std::uint32_t> sessions_;  // numbered in the order of arrival
  std::map<ClientId, std::uint32_t> clients_;
  std::vector<SessionId> session_of_number_;
  std::unordered_map<Cell, Members, CellHash> cells_;
};

}  // namespace mapweave::matching
