#include "whole_map_proposals.h"

#include <mapweave/fusion/wall_weights.h>
#include <mapweave/maps/alignment.h>
#include <mapweave/matching/corner_proposals.h>

#include <algorithm>
#include <cmath>
#include <tuple>

namespace mapweave::fusion {
namespace {

constexpr int kMost = 6;                           // proposals of two maps
constexpr double kLeastShared_m = 2.0;             // walls of one submap near walls of another
constexpr std::size_t kMostQuestions = 6;          // of a proposal
constexpr double kRadius_m = 1.5, kYaw_rad = 0.1;  // how wrong a proposal may be at one of its submaps: maps bend

// Walls of a submap that another one has, about.
double coinciding_m(const PlacedSubmap& of, const Pose2& in_from_of, const WallSight& in) {
  constexpr std::size_t kSome = 80;  // walls that stand for a submap's: bounds time
  constexpr double kCell_m = 0.1;
  const double c = std::cos(in_from_of.phi), s = std::sin(in_from_of.phi);
  const std::size_t count = std::min(kSome, of.walls->size());
  std::size_t hits = 0;
  for (std::size_t k = 0; k < count; ++k) {
    const matching::WallPoint& wall = (*of.walls)[k * of.walls->size() / count];
    hits += in.at(c * wall.x - s * wall.y + in_from_of.x, s * wall.x + c * wall.y + in_from_of.y) == Seen::wall;
  }
  return count == 0
             ? 0.0
             : kCell_m * static_cast<double>(hits) * static_cast<double>(of.walls->size()) / static_cast<double>(count);
}

}  // namespace

const matching::GridWalls& WholeMapProposals::walls(std::size_t map, const std::vector<PlacedSubmap>& submaps,
                                                    const SightOf& sight_of) {
  const auto known = walls_.find(map);
  if (known != walls_.end()) return known->second;
  return walls_.emplace(map, matching::walls_of(SeenRaster(submaps, box_of(submaps), sight_of).grid())).first->second;
}

std::vector<SubmapQuestion> WholeMapProposals::of_most_shared(const std::vector<PlacedSubmap>& submaps_a,
                                                              const std::vector<PlacedSubmap>& submaps_b,
                                                              const Pose2& a_from_b, double radius_m, double yaw_rad,
                                                              const SightOf& sight_of) const {
  std::vector<std::tuple<double, Hash, Hash, std::size_t, std::size_t>> sharing;
  for (std::size_t i = 0; i < submaps_a.size(); ++i)
    for (std::size_t j = 0; j < submaps_b.size(); ++j) {
      const PlacedSubmap &one = submaps_a[i], &other = submaps_b[j];
      const Pose2 middle = compose(a_from_b, Pose2{other.x_m, other.y_m, 0.0});
      if (std::hypot(one.x_m - middle.x, one.y_m - middle.y) > one.radius_m + other.radius_m) continue;
      const double shared_m =
          std::min(coinciding_m(other, between(one.team_from_submap, compose(a_from_b, other.team_from_submap)),
                                *sight_of(one.number)),
                   coinciding_m(one, between(compose(a_from_b, other.team_from_submap), one.team_from_submap),
                                *sight_of(other.number)));
      if (shared_m < kLeastShared_m) continue;
      const auto prints = std::minmax(fingerprint_of(one.number), fingerprint_of(other.number));
      sharing.emplace_back(-shared_m, prints.first, prints.second, i, j);
    }
  std::sort(sharing.begin(), sharing.end());
  if (sharing.size() > kMostQuestions) sharing.resize(kMostQuestions);
  std::vector<SubmapQuestion> questions;
  for (const auto& entry : sharing) {
    const PlacedSubmap &one = submaps_a[std::get<3>(entry)], &other = submaps_b[std::get<4>(entry)];
    const Pose2 expected = between(one.team_from_submap, compose(a_from_b, other.team_from_submap));
    questions.push_back({one.number, other.number, {expected, radius_m, yaw_rad, true}});
  }
  return questions;
}

std::vector<Pose2> WholeMapProposals::proposed(Proposer proposer, std::pair<std::size_t, std::size_t> pair,
                                               const matching::GridWalls& first, const matching::GridWalls& second) {
  std::vector<Pose2>& by_images = proposed_[pair];
  if (proposer == Proposer::whole_maps) {
    matching::GridProposalOptions options;
    options.scale_range = 0.0;
    options.most = kMost;
    options.contradiction = kContradictionWeight;
    for (const matching::GridProposal& proposal : matching::propose_alignments(first, second, options))
      by_images.push_back(proposal.a_from_b.pose);
    return by_images;
  }
  std::vector<Pose2> by_corners;
  for (const matching::CornerProposal& proposal :
       matching::propose_by_corners(first, second, kMost, kContradictionWeight))
    if (std::none_of(by_images.begin(), by_images.end(), [&](const Pose2& known) {
          const Pose2 apart = between(known, proposal.a_from_b);
          return std::hypot(apart.x, apart.y) < kRadius_m && std::abs(apart.phi) < kYaw_rad;
        }))
      by_corners.push_back(proposal.a_from_b);
  return by_corners;
}

std::vector<SubmapQuestion> WholeMapProposals::questions(std::size_t a, std::size_t b, Proposer proposer,
                                                         const std::vector<PlacedSubmap>& submaps_a,
                                                         const std::vector<PlacedSubmap>& submaps_b,
                                                         const SightOf& sight_of) {
  if (submaps_a.empty() || submaps_b.empty()) return {};
  const matching::GridWalls &in_a = walls(a, submaps_a, sight_of), &in_b = walls(b, submaps_b, sight_of);
  // The same whatever the maps are called.
  const bool swapped = maps_[b].fingerprints < maps_[a].fingerprints;
  std::vector<SubmapQuestion> questions;
  for (const Pose2& pose : proposed(proposer, {a, b}, swapped ? in_b : in_a, swapped ? in_a : in_b)) {
    auto some = of_most_shared(submaps_a, submaps_b, swapped ? inverse(pose) : pose, kRadius_m, kYaw_rad, sight_of);
    for (SubmapQuestion& question : some) question.proposer = proposer;
    questions.insert(questions.end(), some.begin(), some.end());
  }
  return questions;
}

}  // namespace mapweave::fusion
