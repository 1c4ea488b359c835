#include "tabu_search.h"

#include <algorithm>
#include <limits>

namespace mapweave::scheduling {

TabuSearch::TabuSearch(const ContractedGraph& graph, std::vector<SizeBounds> bounds,
                       std::vector<std::uint32_t> group_of, RandomBits& random)
    : graph_(graph),
      bounds_(std::move(bounds)),
      group_of_(std::move(group_of)),
      random_(random),
      groups_(static_cast<std::uint32_t>(bounds_.size())),
      linked_(std::size_t{graph.size()} * groups_, 0),
      best_(std::size_t{groups_} * groups_, Best{std::numeric_limits<std::int32_t>::max(), kUnknown}),
      members_(groups_),
      place_(graph.size()),
      active_(groups_, 0),
      all_(graph.size(), 0),
      link_to_(graph.size(), 0),
      robots_(groups_, 0),
      may_give_(groups_),
      may_take_(groups_),
      held_(graph.size(), 0),
      next_held_(graph.size(), kNobody) {
  for (std::uint32_t v = 0; v < graph.size(); ++v) {
    const std::uint32_t own = group_of_[v];
    place_[v] = static_cast<std::uint32_t>(members_[own].size());
    members_[own].push_back(v);
    robots_[own] += graph.robots[v];
    for (std::size_t i = graph.begin[v]; i < graph.begin[v + 1]; ++i)
      linked(v, group_of_[graph.links[i].to]) += graph.links[i].weight;
    for (std::uint32_t g = 0; g < groups_; ++g) all_[v] += linked(v, g);
    cut_ += all_[v] - linked(v, own);
  }
  std::int64_t all = 0;
  for (const std::int32_t linked : all_) all += linked;
  little_ = static_cast<std::int32_t>(all / std::max(1u, 3 * graph.size()));
  for (std::uint32_t v = 0; v < graph.size(); ++v) settle(v);
  cut_ /= 2;
  const std::uint32_t mean = graph.size() / groups_;
  longest_hold_ = 1 + std::min<std::uint32_t>(mean / 4, 40);
  held_until_.assign(longest_hold_ + 2, kNobody);
  best_cut_ = cut_;
  best_group_of_ = group_of_;
  spent_ += graph.links.size() + std::uint64_t{graph.size()} * groups_;
}

bool TabuSearch::within_bounds() const {
  for (std::uint32_t g = 0; g < groups_; ++g)
    if (robots_[g] < bounds_[g].low || robots_[g] > bounds_[g].high) return false;
  return true;
}

const TabuSearch::Best& TabuSearch::best_known(std::uint32_t from, std::uint32_t to) {
  Best& known = best(from, to);
  if (known.vertex != kUnknown) return known;
  known = {std::numeric_limits<std::int32_t>::min(), kNobody};
  const auto look = [&](std::size_t first, std::size_t last) {
    for (std::size_t i = first; i < last; ++i) {
      const std::uint32_t v = members_[from][i];
      if (held_[v]) continue;
      const std::int32_t gain = linked(v, to) - linked(v, from);
      if (known.vertex == kNobody || gain > known.gain) known = {gain, v};
    }
    spent_ += 2 * (last - first) + 5;
  };
  look(0, active_[from]);
  if (known.vertex == kNobody) look(active_[from], members_[from].size());
  return known;
}

void TabuSearch::settle(std::uint32_t v) {
  const std::uint32_t own = group_of_[v], place = place_[v];
  const bool active = all_[v] > linked(v, own) || all_[v] <= little_;
  if (active == (place < active_[own])) return;
  const std::uint32_t other = active ? active_[own]++ : --active_[own];
  std::swap(members_[own][place], members_[own][other]);
  place_[members_[own][place]] = place;
  place_[v] = other;
}

std::int32_t TabuSearch::link_between(std::uint32_t a, std::uint32_t b) const {
  if (graph_.begin[a + 1] - graph_.begin[a] > graph_.begin[b + 1] - graph_.begin[b]) std::swap(a, b);
  for (std::size_t i = graph_.begin[a]; i < graph_.begin[a + 1]; ++i)
    if (graph_.links[i].to == b) return graph_.links[i].weight;
  return 0;
}

bool TabuSearch::may_resize(std::uint32_t from, std::uint32_t to, std::int64_t robots) const {
  return robots_[from] - robots >= bounds_[from].low && robots_[to] + robots <= bounds_[to].high;
}

void TabuSearch::consider(std::uint32_t a, std::uint32_t b, Step& step) {
  if (best(a, b).vertex == kUnknown) {
    best_known(a, b);
    if (!may_beat(a, b, step.gain)) return;
  }
  const Best there = best_known(a, b), back = best_known(b, a);
  const bool some = there.vertex != kNobody, others = back.vertex != kNobody;
  if (some && there.gain > step.gain && may_resize(a, b, graph_.robots[there.vertex]))
    step = {there.gain, there.vertex, kNobody, b};
  if (others && back.gain > step.gain && may_resize(b, a, graph_.robots[back.vertex]))
    step = {back.gain, back.vertex, kNobody, a};
  if (!some || !others) return;
  const std::int64_t most = std::int64_t{there.gain} + back.gain;
  if (most <= step.gain) return;
  const std::int64_t robots = std::int64_t{graph_.robots[there.vertex]} - graph_.robots[back.vertex];
  if (robots != 0 && !may_resize(a, b, robots)) return;
  spent_ += 10;
  const std::int64_t gain = most - 2 * std::int64_t{link_between(there.vertex, back.vertex)};
  if (gain > step.gain) step = {gain, there.vertex, back.vertex, b};
  if (gain == most) return;
  // They are linked, which a swap leaves between the groups: others may do better with either.
  look_for_partner(there.vertex, b, step);
  look_for_partner(back.vertex, a, step);
}

void TabuSearch::look_for_partner(std::uint32_t v, std::uint32_t to, Step& step) {
  const std::uint32_t own = group_of_[v];
  const std::int64_t gain = linked(v, to) - linked(v, own), robots = graph_.robots[v];
  for (std::size_t i = graph_.begin[v]; i < graph_.begin[v + 1]; ++i)
    link_to_[graph_.links[i].to] = graph_.links[i].weight;
  for (std::uint32_t i = 0; i < active_[to]; ++i) {
    const std::uint32_t u = members_[to][i];
    const std::int64_t both = gain + linked(u, own) - linked(u, to) - 2 * std::int64_t{link_to_[u]};
    if (both <= step.gain || held_[u] ||
        (graph_.robots[u] != robots && !may_resize(own, to, robots - graph_.robots[u])))
      continue;
    step = {both, v, u, to};
  }
  for (std::size_t i = graph_.begin[v]; i < graph_.begin[v + 1]; ++i) link_to_[graph_.links[i].to] = 0;
  spent_ += 2 * active_[to] + 2 * (graph_.begin[v + 1] - graph_.begin[v]) + 10;
}

void TabuSearch::move(std::uint32_t v, std::uint32_t to) {
  const std::uint32_t from = group_of_[v];
  cut_ -= linked(v, to) - linked(v, from);
  for (std::size_t i = graph_.begin[v]; i < graph_.begin[v + 1]; ++i) {
    const auto [u, weight] = graph_.links[i];
    std::int32_t* row = &linked(u, 0);
    row[from] -= weight;
    row[to] += weight;
    const std::uint32_t own = group_of_[u];
    if (own == from || own == to) settle(u);
    if (held_[u]) continue;
    if (own == from) {
      for (std::uint32_t g = 0; g < groups_; ++g)
        if (g != own) offer(own, g, u, row[g] - row[own]);
      spent_ += groups_;
    } else if (own == to) {
      Best* known = &best(own, 0);
      for (std::uint32_t g = 0; g < groups_; ++g)
        if (known[g].vertex == u) known[g].vertex = kUnknown;
      spent_ += groups_;
    } else {
      if (best(own, from).vertex == u) best(own, from).vertex = kUnknown;
      offer(own, to, u, row[to] - row[own]);
    }
  }
  spent_ += 4 * (graph_.begin[v + 1] - graph_.begin[v]) + groups_ + 30;
  for (std::uint32_t g = 0; g < groups_; ++g)
    if (best(from, g).vertex == v) best(from, g).vertex = kUnknown;
  std::uint32_t hole = place_[v];
  if (hole < active_[from]) {
    const std::uint32_t last = --active_[from];
    members_[from][hole] = members_[from][last];
    place_[members_[from][hole]] = hole;
    hole = last;
  }
  if (hole + 1 < members_[from].size()) {
    members_[from][hole] = members_[from].back();
    place_[members_[from][hole]] = hole;
  }
  members_[from].pop_back();
  place_[v] = static_cast<std::uint32_t>(members_[to].size());
  members_[to].push_back(v);
  robots_[from] -= graph_.robots[v];
  robots_[to] += graph_.robots[v];
  group_of_[v] = to;
  settle(v);
  changed_.push_back(v);
  if (!held_[v])
    for (std::uint32_t g = 0; g < groups_; ++g)
      if (g != to) offer(to, g, v, linked(v, g) - linked(v, to));
}

void TabuSearch::hold(std::uint32_t v) {
  const std::uint32_t own = group_of_[v];
  held_[v] = 1;
  for (std::uint32_t g = 0; g < groups_; ++g)
    if (best(own, g).vertex == v) best(own, g).vertex = kUnknown;
  std::uint32_t& first = held_until_[(step_ + 1 + random_.below(longest_hold_)) % held_until_.size()];
  next_held_[v] = first;
  first = v;
}

void TabuSearch::let_go() {
  std::uint32_t& first = held_until_[step_ % held_until_.size()];
  for (std::uint32_t v = first; v != kNobody; v = next_held_[v]) {
    held_[v] = 0;
    for (std::uint32_t g = 0; g < groups_; ++g)
      if (g != group_of_[v]) offer(group_of_[v], g, v, linked(v, g) - linked(v, group_of_[v]));
  }
  first = kNobody;
}

void TabuSearch::let_all_go() {
  for (std::uint32_t& first : held_until_) {
    for (std::uint32_t v = first; v != kNobody; v = next_held_[v]) held_[v] = 0;
    first = kNobody;
  }
  for (Best& known : best_) known = {std::numeric_limits<std::int32_t>::max(), kUnknown};
}

void TabuSearch::rebalance() {
  const auto beyond = [&](std::uint32_t g, std::int64_t robots) {
    return std::max<std::int64_t>({0, bounds_[g].low - robots, robots - bounds_[g].high});
  };
  // The move that costs least among those that bring sizes nearer to the bounds. With single robots there is one until
  // all are within.
  while (!within_bounds()) {
    std::uint32_t chosen = kNobody, to = 0;
    std::int64_t most = 0;
    for (std::uint32_t from = 0; from < groups_; ++from)
      for (std::uint32_t other = 0; other < groups_; ++other) {
        if (other == from || (robots_[from] <= bounds_[from].high && robots_[other] >= bounds_[other].low)) continue;
        const std::int64_t now = beyond(from, robots_[from]) + beyond(other, robots_[other]);
        for (const std::uint32_t v : members_[from]) {
          const std::int64_t robots = graph_.robots[v], gain = linked(v, other) - linked(v, from);
          if ((chosen != kNobody && gain <= most) ||
              beyond(from, robots_[from] - robots) + beyond(other, robots_[other] + robots) >= now)
            continue;
          most = gain;
          chosen = v;
          to = other;
        }
        spent_ += 4 * members_[from].size();
      }
    if (chosen == kNobody) break;
    move(chosen, to);
  }
  best_cut_ = cut_;
  best_group_of_ = group_of_;
  changed_.clear();
}

void TabuSearch::go_back_to_best() {
  let_all_go();
  const std::vector<std::uint32_t> changed = changed_;
  for (const std::uint32_t v : changed)
    if (group_of_[v] != best_group_of_[v]) move(v, best_group_of_[v]);
  changed_.clear();
}

void TabuSearch::disturb(std::uint32_t pairs) {
  const auto size = graph_.size();
  for (std::uint32_t i = 0; i < pairs; ++i) {
    const std::uint32_t v = random_.below(size), u = random_.below(size), of_v = group_of_[v], of_u = group_of_[u];
    if (of_v == of_u || graph_.robots[v] != graph_.robots[u]) continue;
    move(v, of_u);
    move(u, of_v);
  }
}

void TabuSearch::search(std::uint64_t work, std::uint64_t patience) {
  const std::uint64_t end = spent_ + work;
  constexpr std::uint32_t kFewGroups = 24, kLooks = 10;
  const bool unit = graph_.most_robots == 1;
  for (std::uint64_t since = 0; since < patience && spent_ < end; ++since) {
    ++step_;
    let_go();
    Step step{std::numeric_limits<std::int64_t>::min(), kNobody, kNobody, 0};
    for (std::uint32_t g = 0; g < groups_; ++g) {
      may_give_[g] = robots_[g] > bounds_[g].low;
      may_take_[g] = robots_[g] < bounds_[g].high;
    }
    open_.clear();
    const auto look = [&](std::uint32_t one, std::uint32_t two) {
      if (!may_beat(one, two, step.gain)) return;
      if (best(one, two).vertex == kUnknown || best(two, one).vertex == kUnknown)
        open_.emplace_back(one, two);
      else
        consider(one, two, step);
    };
    if (groups_ <= kFewGroups) {
      for (std::uint32_t a = 0; a < groups_; ++a)
        for (std::uint32_t b = a + 1; b < groups_; ++b) look(a, b);
      spent_ += groups_ * groups_;
    } else {
      for (std::uint32_t i = 0; i < kLooks; ++i) {
        const std::uint32_t a = random_.below(groups_);
        for (std::uint32_t b = 0; b < groups_; ++b)
          if (b != a) look(std::min(a, b), std::max(a, b));
      }
      spent_ += 2 * kLooks * groups_;
    }
    // What is not known is looked for where it matters.
    for (const auto& [a, b] : open_)
      if (may_beat(a, b, step.gain)) consider(a, b, step);
    if (step.vertex == kNobody) {
      spent_ += 10;
      continue;
    }
    const std::uint32_t from = group_of_[step.vertex];
    held_[step.vertex] = 1;
    move(step.vertex, step.to);
    hold(step.vertex);
    if (step.other != kNobody) {
      std::uint32_t other = step.other;
      if (unit)
        if (const Best now = best_known(step.to, from); now.vertex != kNobody) other = now.vertex;
      held_[other] = 1;
      move(other, from);
      hold(other);
    }
    if (cut_ < best_cut_) {
      best_cut_ = cut_;
      for (const std::uint32_t v : changed_) best_group_of_[v] = group_of_[v];
      changed_.clear();
      since = 0;
    }
  }
  go_back_to_best();
}

}  // namespace mapweave::scheduling
