#include <mapweave/matching/feature_matching.h>

#include <algorithm>
#include <cmath>
#include <numeric>

namespace mapweave::matching {
namespace {

struct Group {
  const std::uint32_t* features;
  std::size_t count;
};

class Matcher {
 public:
  Matcher(const FeaturesView& a, const FeaturesView& b, const MatchingOptions& options)
      : a_(a), b_(b), options_(options) {}

  // Of one node, or of all: every pair is compared from both sides, so that both can say who is nearest.
  void match(const Group& a, const Group& b) {
    for (std::size_t i = 0; i < a.count; ++i) {
      const NearestDescriptors of_a =
          nearest_descriptors(a_.descriptors[a.features[i]], b_.descriptors, b.features, b.count);
      if (!is_clear(of_a)) continue;
      const std::uint32_t partner = b.features[of_a.first];
      const NearestDescriptors of_b = nearest_descriptors(b_.descriptors[partner], a_.descriptors, a.features, a.count);
      if (is_clear(of_b) && of_b.first == i) matches.push_back({a.features[i], partner, of_a.distance});
    }
  }

  std::vector<FeatureMatch> matches;

 private:
  bool is_clear(const NearestDescriptors& nearest) const {
    return nearest.distance <= options_.max_distance &&
           (options_.ratio >= 1.0 || nearest.distance < options_.ratio * nearest.second_distance);
  }
  const FeaturesView& a_;
  const FeaturesView& b_;
  const MatchingOptions& options_;
};

}  // namespace

std::vector<std::uint32_t> order_by_node(const std::uint32_t* nodes, std::size_t count) {
  std::vector<std::uint32_t> order(count);
  std::iota(order.begin(), order.end(), 0U);
  std::stable_sort(order.begin(), order.end(),
                   [&](std::uint32_t left, std::uint32_t right) { return nodes[left] < nodes[right]; });
  return order;
}

std::vector<FeatureMatch> match_features(const FeaturesView& a, const FeaturesView& b, const MatchingOptions& options) {
  Matcher matcher(a, b, options);
  if (a.nodes != nullptr && b.nodes != nullptr) {
    const auto order_of = [](const FeaturesView& features, std::vector<std::uint32_t>& own) {
      if (features.by_node != nullptr) return features.by_node;
      own = order_by_node(features.nodes, features.count);
      return static_cast<const std::uint32_t*>(own.data());
    };
    std::vector<std::uint32_t> own_of_a, own_of_b;
    const std::uint32_t *of_a = order_of(a, own_of_a), *of_b = order_of(b, own_of_b);
    const auto end_of_group = [](const FeaturesView& features, const std::uint32_t* order, std::size_t begin) {
      std::size_t end = begin;
      while (end < features.count && features.nodes[order[end]] == features.nodes[order[begin]]) ++end;
      return end;
    };
    for (std::size_t i = 0, j = 0; i < a.count && j < b.count;) {
      const std::size_t i_end = end_of_group(a, of_a, i), j_end = end_of_group(b, of_b, j);
      const std::uint32_t node_a = a.nodes[of_a[i]], node_b = b.nodes[of_b[j]];
      if (node_a == node_b) matcher.match({of_a + i, i_end - i}, {of_b + j, j_end - j});
      if (node_a <= node_b) i = i_end;
      if (node_b <= node_a) j = j_end;
    }
  } else {
    std::vector<std::uint32_t> all(std::max(a.count, b.count));
    std::iota(all.begin(), all.end(), 0U);
    matcher.match({all.data(), a.count}, {all.data(), b.count});
  }
  std::sort(matcher.matches.begin(), matcher.matches.end(),
            [](const FeatureMatch& left, const FeatureMatch& right) { return left.a < right.a; });
  return turning_alike(a, b, std::move(matcher.matches), options.rotation_window_deg);
}

std::vector<FeatureMatch> turning_alike(const FeaturesView& a, const FeaturesView& b, std::vector<FeatureMatch> matches,
                                        double window_deg) {
  constexpr std::size_t kFew = 8, kBins = 36;  // fewer show no common angle; of 10 degrees each
  if (matches.size() < kFew || window_deg >= 360.0 || a.points == nullptr || b.points == nullptr) return matches;
  const auto bin_of = [&](const FeatureMatch& match) {
    const double turn =
        static_cast<double>(b.points[match.b].angle_deg) - static_cast<double>(a.points[match.a].angle_deg);
    const double whole = std::isfinite(turn) ? turn - 360.0 * std::floor(turn / 360.0) : 0.0;
    return std::min(kBins - 1, static_cast<std::size_t>(whole / 360.0 * kBins));
  };
  std::array<std::size_t, kBins> count{};
  for (const FeatureMatch& match : matches) ++count[bin_of(match)];
  const auto width = std::max<std::size_t>(1, static_cast<std::size_t>(window_deg / 360.0 * kBins));
  std::size_t best = 0, first = 0;
  for (std::size_t start = 0; start < kBins; ++start) {
    std::size_t sum = 0;
    for (std::size_t i = 0; i < width; ++i) sum += count[(start + i) % kBins];
    if (sum > best) {
      best = sum;
      first = start;
    }
  }
  matches.erase(
      std::remove_if(matches.begin(), matches.end(),
                     [&](const FeatureMatch& match) { return (bin_of(match) + kBins - first) % kBins >= width; }),
      matches.end());
  return matches;
}

}  // namespace mapweave::matching
