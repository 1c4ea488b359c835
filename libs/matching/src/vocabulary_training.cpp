// Hierarchical k-medians: a node's descriptors are parted among k centres, each the majority of its members bit by bit,
// and every part is parted again one level below.

#include "counted_random.h"
#include "vocabulary_tree.h"

#include <mapweave/core/error.h>
#include <mapweave/core/interrupt.h>

#include <algorithm>
#include <cmath>

namespace mapweave::matching {
namespace {

using Members = std::vector<std::uint32_t>;

struct Part {
  OrbDescriptor centre;
  Members members;
};

class Clustering {
 public:
  Clustering(const std::vector<OrbDescriptor>& all, const VocabularyOptions& options) : all_(all), options_(options) {}

  // Parts of at least one member each, in the order in which their first centres were drawn.
  std::vector<Part> operator()(const Members& members, std::uint64_t node) const {
    std::vector<OrbDescriptor> centres = first_centres(members, node);
    std::vector<std::uint32_t> nearest = assign(members, centres);
    for (int iteration = 0; iteration < options_.iterations && centres.size() > 1; ++iteration) {
      std::vector<OrbDescriptor> moved = medians(members, nearest, centres);
      if (moved == centres) break;
      centres = std::move(moved);
      nearest = assign(members, centres);
    }
    std::vector<Part> parts(centres.size());
    for (std::size_t c = 0; c < centres.size(); ++c) parts[c].centre = centres[c];
    for (std::size_t i = 0; i < members.size(); ++i) parts[nearest[i]].members.push_back(members[i]);
    parts.erase(std::remove_if(parts.begin(), parts.end(), [](const Part& part) { return part.members.empty(); }),
                parts.end());
    return parts;
  }

 private:
  // Greedy k-means++ (Arthur, Vassilvitskii, SODA 2007): candidates for each next centre are drawn by the squared
  // distance to those there are, and the one that leaves least is taken. Ends early where no other descriptor is left.
  std::vector<OrbDescriptor> first_centres(const Members& members, std::uint64_t node) const {
    constexpr int kCandidates = 4;  // of each new centre, of which the best is kept (k-means++)
    CountedRandom random(options_.seed, node);
    std::vector<OrbDescriptor> centres = {all_[members[random.below(members.size())]]};
    Squares squares(members.size(), 257 * 257);
    std::uint64_t total = lower(squares, members, centres.back());
    while (centres.size() < static_cast<std::size_t>(options_.branching) && total > 0) {
      Squares best_squares;
      std::uint64_t best_total = total;
      OrbDescriptor best{};
      for (int candidate = 0; candidate < kCandidates; ++candidate) {
        std::uint64_t drawn = random.below(total);
        std::size_t i = 0;
        while (drawn >= squares[i]) drawn -= squares[i++];
        Squares lowered = squares;
        const std::uint64_t left = lower(lowered, members, all_[members[i]]);
        if (left < best_total) {
          best_total = left;
          best = all_[members[i]];
          best_squares = std::move(lowered);
        }
      }
      centres.push_back(best);
      squares = std::move(best_squares);
      total = best_total;
    }
    return centres;
  }

  // Squared distances to the nearest centre, with one more centre; answers their sum.
  using Squares = std::vector<std::uint32_t>;
  std::uint64_t lower(Squares& squares, const Members& members, const OrbDescriptor& centre) const {
    std::uint64_t total = 0;
    for (std::size_t i = 0; i < members.size(); ++i) {
      const auto distance = static_cast<std::uint32_t>(nearest_descriptors(all_[members[i]], &centre, 1).distance);
      squares[i] = std::min(squares[i], distance * distance);
      total += squares[i];
    }
    return total;
  }

  std::vector<std::uint32_t> assign(const Members& members, const std::vector<OrbDescriptor>& centres) const {
    std::vector<std::uint32_t> nearest;
    nearest.reserve(members.size());
    for (const std::uint32_t member : members)
      nearest.push_back(nearest_descriptors(all_[member], centres.data(), centres.size()).first);
    return nearest;
  }

  // The majority of each bit; where there is none, and where a centre has no members, the old bit.
  std::vector<OrbDescriptor> medians(const Members& members, const std::vector<std::uint32_t>& nearest,
                                     const std::vector<OrbDescriptor>& old) const {
    std::vector<std::array<std::uint32_t, 256>> ones(old.size());
    std::vector<std::uint32_t> count(old.size(), 0);
    for (auto& bits : ones) bits.fill(0);
    for (std::size_t i = 0; i < members.size(); ++i) {
      const OrbDescriptor& descriptor = all_[members[i]];
      auto& bits = ones[nearest[i]];
      ++count[nearest[i]];
      for (std::size_t word = 0; word < 4; ++word)
        for (std::size_t bit = 0; bit < 64; ++bit)
          bits[64 * word + bit] += static_cast<std::uint32_t>(descriptor[word] >> bit & 1);
    }
    std::vector<OrbDescriptor> centres = old;
    for (std::size_t c = 0; c < old.size(); ++c)
      for (std::size_t bit = 0; bit < 256; ++bit) {
        const std::uint64_t mask = std::uint64_t{1} << (bit % 64);
        if (2 * ones[c][bit] > count[c]) centres[c][bit / 64] |= mask;
        if (2 * ones[c][bit] < count[c]) centres[c][bit / 64] &= ~mask;
      }
    return centres;
  }

  const std::vector<OrbDescriptor>& all_;
  const VocabularyOptions& options_;
};

bool all_equal(const Members& members, const std::vector<OrbDescriptor>& all) {
  return std::all_of(members.begin(), members.end(),
                     [&](std::uint32_t member) { return all[member] == all[members.front()]; });
}

// Pictures in which each leaf has members, as ln(pictures / pictures with it), in steps of 1/65536 so that no bit
// depends on the machine.
double idf(const Members& members, const std::vector<std::size_t>& ends) {
  std::size_t pictures_with = 0, picture = 0, counted_until = 0;
  for (const std::uint32_t member : members) {  // rising
    if (member < counted_until) continue;
    while (ends[picture] <= member) ++picture;
    counted_until = ends[picture];
    ++pictures_with;
  }
  return std::round(std::log(static_cast<double>(ends.size()) / static_cast<double>(pictures_with)) * 65536.0) /
         65536.0;
}

}  // namespace

BinaryVocabulary train_vocabulary(const VocabularyPictures& pictures, const VocabularyOptions& options,
                                  Progress& progress) {
  check(options);
  const auto& all = pictures.descriptors;
  if (all.empty())
    throw Error(ErrorCode::kBadInput, "no features to make a vocabulary of", {},
                "name logs with pictures that show something");
  MAPWEAVE_EXPECT(!pictures.ends.empty() && pictures.ends.back() == all.size() &&
                      std::is_sorted(pictures.ends.begin(), pictures.ends.end()),
                  "pictures follow each other");
  const Clustering cluster(all, options);
  ProgressTask task(progress, "vocabulary", all.size(), "features");

  struct Waiting {
    std::uint32_t number;  // of the node in `nodes` + 1; 0: root
    Members members;
  };
  std::vector<PlainNode> nodes;
  std::vector<Waiting> level(1);
  for (std::uint32_t i = 0; i < all.size(); ++i) level[0].members.push_back(i);
  std::size_t done = 0;
  for (int depth = 1; depth <= options.levels; ++depth) {
    std::vector<Waiting> below;
    for (const Waiting& parent : level) {
      throw_if_interrupted();
      for (Part& part : cluster(parent.members, parent.number)) {
        PlainNode node;
        node.parent = parent.number;
        node.descriptor = part.centre;
        node.leaf = depth == options.levels || part.members.size() == 1 || all_equal(part.members, all);
        if (node.leaf) {
          node.weight = idf(part.members, pictures.ends);
          done += part.members.size();
        } else {
          below.push_back({static_cast<std::uint32_t>(nodes.size() + 1), std::move(part.members)});
        }
        nodes.push_back(node);
      }
      task.advance(done);
    }
    level = std::move(below);
  }
  return plant(options.branching, options.levels, nodes);
}

}  // namespace mapweave::matching
