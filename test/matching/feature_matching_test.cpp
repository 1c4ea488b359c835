#include <gtest/gtest.h>
#include <mapweave/matching/feature_matching.h>

#include <random>

namespace mapweave::matching {
namespace {

struct Picture {
  OrbFeatures features;
  std::vector<std::uint32_t> nodes;
  FeaturesView view(bool with_nodes = false) const {
    FeaturesView view = view_of(features);
    if (with_nodes) view.nodes = nodes.data();
    return view;
  }
};

OrbDescriptor with_flips(OrbDescriptor descriptor, int flips, std::mt19937_64& random) {
  for (int i = 0; i < flips; ++i) {
    const std::uint64_t bit = random() % 256;
    descriptor[bit / 64] ^= std::uint64_t{1} << (bit % 64);
  }
  return descriptor;
}

// b shows what a shows, in reverse order, turned by 40 degrees, with bits flipped; some of each are strangers.
std::pair<Picture, Picture> two_pictures(std::uint64_t seed, int shared, int strangers) {
  std::mt19937_64 random(seed);
  Picture a, b;
  for (int i = 0; i < shared + strangers; ++i) {
    a.features.descriptors.push_back({random(), random(), random(), random()});
    a.features.points.push_back({0.0f, 0.0f, static_cast<float>(random() % 360), 0});
    a.nodes.push_back(static_cast<std::uint32_t>(random() % 10));
  }
  for (int i = shared + strangers; i-- > 0;) {
    const auto from = static_cast<std::size_t>(i);
    const bool stranger = i >= shared;
    b.features.descriptors.push_back(stranger ? OrbDescriptor{random(), random(), random(), random()}
                                              : with_flips(a.features.descriptors[from], 15, random));
    const float angle = a.features.points[from].angle_deg + 40.0f;
    b.features.points.push_back({0.0f, 0.0f, angle >= 360.0f ? angle - 360.0f : angle, 0});
    b.nodes.push_back(a.nodes[from]);
  }
  return {a, b};
}

std::vector<FeatureMatch> by_brute_force(const Picture& a, const Picture& b, const MatchingOptions& options,
                                         bool by_node) {
  std::vector<FeatureMatch> matches;
  const auto nearest = [&](const Picture& of, std::uint32_t i, const Picture& among) {
    int first = 257, second = 257;
    std::uint32_t index = 0;
    for (std::uint32_t j = 0; j < among.nodes.size(); ++j) {
      if (by_node && of.nodes[i] != among.nodes[j]) continue;
      const int distance = hamming(of.features.descriptors[i], among.features.descriptors[j]);
      if (distance < first) {
        second = first;
        first = distance;
        index = j;
      } else {
        second = std::min(second, distance);
      }
    }
    const bool clear = first <= options.max_distance && (options.ratio >= 1.0 || first < options.ratio * second);
    return clear ? std::make_pair(index, first) : std::make_pair(std::uint32_t{999999}, first);
  };
  for (std::uint32_t i = 0; i < a.nodes.size(); ++i) {
    const auto [j, distance] = nearest(a, i, b);
    if (j != 999999 && nearest(b, j, a).first == i) matches.push_back({i, j, distance});
  }
  return matches;
}

void expect_same(const std::vector<FeatureMatch>& one, const std::vector<FeatureMatch>& other) {
  ASSERT_EQ(one.size(), other.size());
  for (std::size_t i = 0; i < one.size(); ++i) {
    EXPECT_EQ(one[i].a, other[i].a);
    EXPECT_EQ(one[i].b, other[i].b);
    EXPECT_EQ(one[i].distance, other[i].distance);
  }
}

TEST(MatchFeatures, agrees_with_brute_force) {
  MatchingOptions options;
  options.max_distance = 110;  // so that strangers pair too
  options.ratio = 0.95;
  options.rotation_window_deg = 360.0;
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const auto [a, b] = two_pictures(seed, 60, 60);
    expect_same(match_features(a.view(), b.view(), options), by_brute_force(a, b, options, false));
    expect_same(match_features(a.view(true), b.view(true), options), by_brute_force(a, b, options, true));
    EXPECT_GE(by_brute_force(a, b, options, true).size(), 60U);
  }
}

TEST(MatchFeatures, is_the_same_from_both_sides) {
  const auto [a, b] = two_pictures(7, 50, 50);
  auto there = match_features(a.view(true), b.view(true)), back = match_features(b.view(true), a.view(true));
  for (FeatureMatch& match : back) std::swap(match.a, match.b);
  std::sort(back.begin(), back.end(), [](const FeatureMatch& l, const FeatureMatch& r) { return l.a < r.a; });
  expect_same(there, back);
  EXPECT_EQ(there.size(), 50U);
}

TEST(MatchFeatures, leaves_twins_alone) {
  auto [a, b] = two_pictures(7, 30, 0);
  b.features.descriptors[4] = b.features.descriptors[9];
  EXPECT_EQ(match_features(a.view(), b.view()).size(), 28U);
}

TEST(MatchFeatures, drops_what_turned_otherwise_than_most) {
  auto [a, b] = two_pictures(7, 40, 0);
  for (std::size_t i = 0; i < 6; ++i)
    b.features.points[i].angle_deg = std::fmod(b.features.points[i].angle_deg + 150.0f, 360.0f);
  EXPECT_EQ(match_features(a.view(), b.view()).size(), 34U);
  MatchingOptions any_turn;
  any_turn.rotation_window_deg = 360.0;
  EXPECT_EQ(match_features(a.view(), b.view(), any_turn).size(), 40U);
}

TEST(MatchFeatures, has_no_answer_for_empty_pictures) {
  const auto [a, b] = two_pictures(7, 5, 0);
  EXPECT_TRUE(match_features(a.view(), FeaturesView{}).empty());
  EXPECT_TRUE(match_features(FeaturesView{}, b.view()).empty());
}

}  // namespace
}  // namespace mapweave::matching
