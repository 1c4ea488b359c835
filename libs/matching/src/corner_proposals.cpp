#include <mapweave/matching/corner_proposals.h>

#include "distinct_alignments.h"
#include "point_registration.h"

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <limits>
#include <tuple>

namespace mapweave::matching {
namespace {

// How pairs of corners vote: cells of place (of the middle of b's corners) and heading.
constexpr double kVoteCell_m = 1.0, kVoteCell_rad = 8.0 * M_PI / 180.0;
constexpr double kOpeningsAlike_rad = 20.0 * M_PI / 180.0;
constexpr std::size_t kFewestVotes = 2;
constexpr std::size_t kMostPlaces = 1000;  // that are looked at: in a large building chance has as many votes
constexpr std::size_t kMostRefined = 60;   // of them by their corners and walls
// Corners that lie on each other.
constexpr double kSameCorner_m = 0.8, kSameCorner_rad = 20.0 * M_PI / 180.0;
constexpr std::size_t kFewestFaces = 10;
constexpr std::size_t kSomeFaces = 400;  // that stand for all of a map: bounds time
constexpr double kDeep_m = 0.5;          // from here on free space contradicts a wall

// Where walls are, and which way they face, at a glance.
class FaceRaster {
 public:
  explicit FaceRaster(const std::vector<WallPoint>& faces) {
    for (const WallPoint& face : faces) {
      x0_ = std::min(x0_, cell_of(face.x) - 1);
      y0_ = std::min(y0_, cell_of(face.y) - 1);
      x1_ = std::max(x1_, cell_of(face.x) + 1);
      y1_ = std::max(y1_, cell_of(face.y) + 1);
    }
    columns_ = x1_ - x0_ + 1;
    sectors_.assign(static_cast<std::size_t>(columns_) * static_cast<std::size_t>(y1_ - y0_ + 1), 0);
    for (const WallPoint& face : faces) {
      const int sector = sector_of(face);
      const auto facing = static_cast<std::uint16_t>(bit(sector - 1) | bit(sector) | bit(sector + 1));
      for (int y = cell_of(face.y) - 1; y <= cell_of(face.y) + 1; ++y)
        for (int x = cell_of(face.x) - 1; x <= cell_of(face.x) + 1; ++x) sectors_[index(x, y)] |= facing;
    }
  }
  bool has(const WallPoint& face) const {
    const int x = cell_of(face.x), y = cell_of(face.y);
    if (x < x0_ || y < y0_ || x > x1_ || y > y1_) return false;
    return (sectors_[index(x, y)] & bit(sector_of(face))) != 0;
  }

 private:
  static constexpr double kCell_m = 0.17;  // a face reaches into the cells beside its own
  static constexpr int kSectors = 16;
  static int cell_of(float metres) { return static_cast<int>(std::floor(static_cast<double>(metres) / kCell_m)); }
  static int sector_of(const WallPoint& face) {
    const double turns = std::atan2(face.normal_y, face.normal_x) / (2.0 * M_PI);
    return static_cast<int>(std::floor((turns - std::floor(turns)) * kSectors)) % kSectors;
  }
  static std::uint16_t bit(int sector) {
    return static_cast<std::uint16_t>(1U << static_cast<unsigned>((sector + kSectors) % kSectors));
  }
  std::size_t index(int x, int y) const {
    return static_cast<std::size_t>(y - y0_) * static_cast<std::size_t>(columns_) + static_cast<std::size_t>(x - x0_);
  }

  int x0_ = std::numeric_limits<int>::max(), y0_ = x0_, x1_ = std::numeric_limits<int>::min(), y1_ = x1_, columns_ = 0;
  std::vector<std::uint16_t> sectors_;  // that walls in and beside a cell face
};

std::vector<WallPoint> some_of(const std::vector<WallPoint>& faces, std::size_t most) {
  if (faces.size() <= most) return faces;
  std::vector<WallPoint> some;
  for (std::size_t i = 0; i < most; ++i) some.push_back(faces[i * faces.size() / most]);
  return some;
}

Point2f moved(const Pose2& pose, Point2f p) {
  const double c = std::cos(pose.phi), s = std::sin(pose.phi);
  return {static_cast<float>(pose.x + c * p.x - s * p.y), static_cast<float>(pose.y + s * p.x + c * p.y)};
}

Pose2 pose_of(const Eigen::Matrix4f& m) {
  return {static_cast<double>(m(0, 3)), static_cast<double>(m(1, 3)),
          std::atan2(static_cast<double>(m(1, 0)), static_cast<double>(m(0, 0)))};
}

class CornerSearch {
 public:
  CornerSearch(const GridWalls& a, const GridWalls& b, double contradiction)
      : a_(a),
        b_(b),
        contradiction_(contradiction),
        corners_a_(corners_of(a)),
        corners_b_(corners_of(b)),
        faces_a_(some_of(a.faces, kSomeFaces)),
        faces_b_(some_of(b.faces, kSomeFaces)),
        raster_a_(a.faces),
        raster_b_(b.faces) {
    for (const WallCorner& corner : corners_b_) {
      middle_b_.x += corner.at.x / static_cast<float>(corners_b_.size());
      middle_b_.y += corner.at.y / static_cast<float>(corners_b_.size());
    }
  }

  std::vector<CornerProposal> best(std::size_t most) const {
    std::vector<CornerProposal> found;
    for (const Pose2& voted : voted_places()) found.push_back({voted, score_m(voted)});
    sort(found);
    if (found.size() > kMostRefined) found.resize(kMostRefined);
    const PointRegistration walls_a(a_.faces);
    for (CornerProposal& proposal : found) {
      better(proposal, laid_on_corners(proposal.a_from_b));
      const std::vector<WallPoint> there = placed(proposal.a_from_b, faces_b_);
      if (const auto refined = walls_a.refine(there, {0.8, 0.6, 0.4, 0.3, 0.25}, kFewestFaces))
        better(proposal, compose(pose_of(refined->moved), proposal.a_from_b));
    }
    sort(found);
    return distinct(found, most);
  }

 private:
  struct Vote {
    int yaw, x, y;
    Pose2 a_from_b;
    bool in_cell(const Vote& other) const { return std::tie(yaw, x, y) == std::tie(other.yaw, other.x, other.y); }
  };

  // Poses for which most pairs of corners vote.
  std::vector<Pose2> voted_places() const {
    std::vector<Vote> votes;
    for (const WallCorner& in_a : corners_a_)
      for (const WallCorner& in_b : corners_b_) {
        if (in_a.is_outer != in_b.is_outer || std::abs(in_a.opening_rad - in_b.opening_rad) > kOpeningsAlike_rad)
          continue;
        Pose2 pose(0.0, 0.0, wrap_angle(in_a.direction_rad - in_b.direction_rad));
        const Point2f turned = moved(pose, in_b.at);
        pose.x = static_cast<double>(in_a.at.x - turned.x);
        pose.y = static_cast<double>(in_a.at.y - turned.y);
        const Point2f middle = moved(pose, middle_b_);
        votes.push_back({static_cast<int>(std::lround(pose.phi / kVoteCell_rad)),
                         static_cast<int>(std::lround(middle.x / kVoteCell_m)),
                         static_cast<int>(std::lround(middle.y / kVoteCell_m)), pose});
      }
    std::stable_sort(votes.begin(), votes.end(), [](const Vote& l, const Vote& r) {
      return std::tie(l.yaw, l.x, l.y) < std::tie(r.yaw, r.x, r.y);
    });
    std::vector<std::pair<std::size_t, std::size_t>> cells;  // votes, the first one
    for (std::size_t i = 0, end = 0; i < votes.size(); i = end) {
      while (end < votes.size() && votes[end].in_cell(votes[i])) ++end;
      if (end - i >= kFewestVotes) cells.emplace_back(end - i, i);
    }
    std::stable_sort(cells.begin(), cells.end(), [](const auto& l, const auto& r) { return l.first > r.first; });
    if (cells.size() > kMostPlaces) cells.resize(kMostPlaces);
    std::vector<Pose2> places;
    for (const auto& [count, first] : cells) {
      Pose2 mean = votes[first].a_from_b;
      double x = 0.0, y = 0.0, phi = 0.0;
      for (std::size_t i = first; i < first + count; ++i) {
        const Point2f middle = moved(votes[i].a_from_b, middle_b_);
        x += middle.x / static_cast<double>(count);
        y += middle.y / static_cast<double>(count);
        phi += wrap_angle(votes[i].a_from_b.phi - mean.phi) / static_cast<double>(count);
      }
      mean.phi = wrap_angle(mean.phi + phi);
      const Point2f turned = moved(Pose2(0.0, 0.0, mean.phi), middle_b_);
      places.emplace_back(x - static_cast<double>(turned.x), y - static_cast<double>(turned.y), mean.phi);
    }
    return places;
  }

  // By the corners that lie near each other there.
  Pose2 laid_on_corners(Pose2 a_from_b) const {
    std::vector<Point2f> from, to;
    for (const WallCorner& in_b : corners_b_) {
      const Point2f at = moved(a_from_b, in_b.at);
      double nearest = kSameCorner_m;
      const WallCorner* partner = nullptr;
      for (const WallCorner& in_a : corners_a_) {
        const double distance = std::hypot(in_a.at.x - at.x, in_a.at.y - at.y);
        if (in_a.is_outer != in_b.is_outer || distance >= nearest ||
            std::abs(wrap_angle(in_a.direction_rad - in_b.direction_rad - a_from_b.phi)) > kSameCorner_rad)
          continue;
        nearest = distance;
        partner = &in_a;
      }
      if (partner == nullptr) continue;
      from.push_back(at);
      to.push_back(partner->at);
    }
    if (from.size() < kFewestVotes) return a_from_b;
    const Eigen::Matrix4f motion = planar_motion(from, to);
    return motion.allFinite() ? compose(pose_of(motion), a_from_b) : a_from_b;
  }

  void better(CornerProposal& proposal, const Pose2& a_from_b) const {
    const double score = score_m(a_from_b);
    if (score > proposal.score_m) proposal = {a_from_b, score};
  }

  double score_m(const Pose2& a_from_b) const {
    return 0.5 *
           (gain_m(faces_b_, b_, a_, raster_a_, a_from_b) + gain_m(faces_a_, a_, b_, raster_b_, inverse(a_from_b)));
  }

  double gain_m(const std::vector<WallPoint>& faces, const GridWalls& of, const GridWalls& in,
                const FaceRaster& walls_in, const Pose2& in_from_of) const {
    if (faces.empty()) return 0.0;
    std::size_t on_walls = 0, deep = 0;
    for (const WallPoint& face : placed(in_from_of, faces)) {
      on_walls += walls_in.has(face) ? 1 : 0;
      deep += static_cast<double>(in.depth_at(face.x, face.y)) > kDeep_m ? 1 : 0;
    }
    return of.wall_m() / static_cast<double>(faces.size()) *
           (static_cast<double>(on_walls) - contradiction_ * static_cast<double>(deep));
  }

  static void sort(std::vector<CornerProposal>& proposals) {
    std::stable_sort(proposals.begin(), proposals.end(),
                     [](const CornerProposal& l, const CornerProposal& r) { return l.score_m > r.score_m; });
  }

  std::vector<CornerProposal> distinct(const std::vector<CornerProposal>& sorted, std::size_t most) const {
    std::vector<CornerProposal> kept;
    for (const CornerProposal& proposal : sorted) {
      if (kept.size() == most || proposal.score_m <= 0.0) break;
      const Point2f middle = moved(proposal.a_from_b, middle_b_);
      if (std::all_of(kept.begin(), kept.end(), [&](const CornerProposal& other) {
            const Point2f its_middle = moved(other.a_from_b, middle_b_);
            return std::hypot(middle.x - its_middle.x, middle.y - its_middle.y) > kApart_m ||
                   std::abs(wrap_angle(proposal.a_from_b.phi - other.a_from_b.phi)) > kApart_rad;
          }))
        kept.push_back(proposal);
    }
    return kept;
  }

  const GridWalls &a_, &b_;
  double contradiction_;
  std::vector<WallCorner> corners_a_, corners_b_;
  std::vector<WallPoint> faces_a_, faces_b_;  // some of all
  FaceRaster raster_a_, raster_b_;
  Point2f middle_b_{0.0F, 0.0F};
};

}  // namespace

std::vector<CornerProposal> propose_by_corners(const GridWalls& a, const GridWalls& b, std::size_t most,
                                               double contradiction) {
  if (a.faces.empty() || b.faces.empty()) return {};
  return CornerSearch(a, b, contradiction).best(most);
}

}  // namespace mapweave::matching
