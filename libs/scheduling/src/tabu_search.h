#pragma once
// Tabu search on a grouping whose sizes stay within bounds. What each vertex is linked to in each group is kept up to
// date; so is, for each ordered pair of groups, the vertex that would gain most by moving from one to the other. A step
// is the best single move that the bounds allow or the best swap (as Kernighan and Lin 1970: the second half is chosen
// after the first was made); who moved stays for some steps.

#include "contracted_graph.h"

#include <cstdint>
#include <utility>
#include <vector>

namespace mapweave::scheduling {

struct SizeBounds {
  std::int64_t low, high;  // robots
};

class TabuSearch {
 public:
  // The graph must outlive it. Memory: 4 bytes per vertex and group, 8 per pair of groups.
  TabuSearch(const ContractedGraph&, std::vector<SizeBounds>, std::vector<std::uint32_t> group_of, RandomBits&);

  // Moves vertices at the least cost until all groups are within bounds, or no move helps.
  void rebalance();
  // Until `work` is spent (about a nanosecond each) or `patience` steps brought nothing. Ends at the best grouping it
  // saw.
  void search(std::uint64_t work, std::uint64_t patience);
  // Swaps `pairs` times at random.
  void disturb(std::uint32_t pairs);

  const std::vector<std::uint32_t>& group_of() const { return group_of_; }
  std::int64_t cut() const { return cut_; }
  bool within_bounds() const;
  std::uint64_t spent() const { return spent_; }

 private:
  struct Best {
    std::int32_t gain;     // of kUnknown: none gains more
    std::uint32_t vertex;  // kNobody, kUnknown
  };
  struct Step {
    std::int64_t gain;
    std::uint32_t vertex, other;  // other: kNobody for a single move
    std::uint32_t to;
  };
  std::int32_t& linked(std::uint32_t vertex, std::uint32_t group) {
    return linked_[std::size_t{vertex} * groups_ + group];
  }
  Best& best(std::uint32_t from, std::uint32_t to) { return best_[std::size_t{from} * groups_ + to]; }
  void offer(std::uint32_t from, std::uint32_t to, std::uint32_t vertex, std::int32_t gain) {
    Best& known = best(from, to);
    if (gain > known.gain) known = {gain, vertex};
  }
  const Best& best_known(std::uint32_t from, std::uint32_t to);
  std::int32_t link_between(std::uint32_t, std::uint32_t) const;
  bool may_resize(std::uint32_t from, std::uint32_t to, std::int64_t robots) const;
  // By what is known of gains; robots count as one each, which allows more than is so.
  bool may_beat(std::uint32_t a, std::uint32_t b, std::int64_t gain) const {
    const std::int64_t there = best_[std::size_t{a} * groups_ + b].gain,
                       back = best_[std::size_t{b} * groups_ + a].gain;
    return there + back > gain || (there > gain && may_give_[a] && may_take_[b]) ||
           (back > gain && may_give_[b] && may_take_[a]);
  }
  void consider(std::uint32_t a, std::uint32_t b, Step& step);
  void look_for_partner(std::uint32_t vertex, std::uint32_t to, Step& step);
  void move(std::uint32_t vertex, std::uint32_t to);
  void hold(std::uint32_t vertex);
  void settle(std::uint32_t vertex);  // among the active members or the others
  void let_go();                      // those whose time is over
  void let_all_go();
  void go_back_to_best();

  static constexpr std::uint32_t kNobody = ~std::uint32_t{0}, kUnknown = kNobody - 1;
  const ContractedGraph& graph_;
  std::vector<SizeBounds> bounds_;
  std::vector<std::uint32_t> group_of_;
  RandomBits& random_;
  std::uint32_t groups_, longest_hold_;
  std::vector<std::int32_t> linked_;
  std::vector<Best> best_;
  std::vector<std::pair<std::uint32_t, std::uint32_t>>
      open_;  // pairs of groups to be considered, of which something is unknown
  std::vector<std::vector<std::uint32_t>> members_;
  std::vector<std::uint32_t> place_;  // in members_
  std::vector<std::uint32_t>
      active_;  // by group: so many members, the first ones, are looked at: those linked to other groups, or to little
  std::vector<std::int32_t> all_;      // what a vertex is linked to
  std::vector<std::int32_t> link_to_;  // all 0 between uses
  std::int32_t little_ = 0;
  std::vector<std::int64_t> robots_;               // by group
  std::vector<std::uint8_t> may_give_, may_take_;  // by group: one robot
  std::vector<std::uint8_t> held_;
  std::vector<std::uint32_t> held_until_,
      next_held_;  // a ring by step of lists: the first of each, and who follows whom
  std::uint64_t step_ = 0, spent_ = 0;
  std::int64_t cut_ = 0, best_cut_ = 0;
  std::vector<std::uint32_t> best_group_of_, changed_;  // changed_: since the best
};

}  // namespace mapweave::scheduling
