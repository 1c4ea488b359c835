#include "vocabulary_tree.h"

#include <mapweave/core/error.h>
#include <mapweave/core/processor_clones.h>

#include <algorithm>
#include <cmath>

namespace mapweave::matching {
namespace {

// Leaf that the descriptor falls to; passed: the node at direct_level on the way, or the leaf.
MAPWEAVE_POPCOUNT_CLONES std::uint32_t descend(const OrbDescriptor& query, const VocabularyNode* nodes,
                                               const OrbDescriptor* descriptors, std::uint32_t root_children,
                                               int direct_level, std::uint32_t& passed) {
  std::uint32_t first = 0, count = root_children, at = 0;
  for (int level = 1; count > 0; ++level) {
    int least = 257;
    for (std::uint32_t child = first; child < first + count; ++child) {
      const int distance = hamming(query, descriptors[child]);
      if (distance < least) {
        least = distance;
        at = child;
      }
    }
    if (level <= direct_level) passed = at;
    first = nodes[at].first_child;
    count = nodes[at].children;
  }
  return at;
}

Hash hash_of(const BinaryVocabulary::Tree& tree) {
  Hasher hasher;
  hasher.add("binary vocabulary 1").add(std::int64_t{tree.branching}).add(std::int64_t{tree.levels});
  for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
    hasher.add(std::int64_t{tree.nodes[i].parent});
    for (const std::uint64_t word : tree.descriptors[i]) hasher.add(static_cast<std::int64_t>(word));
    hasher.add(tree.nodes[i].children == 0 ? tree.weight_of_word[tree.nodes[i].word] : -1.0);
  }
  return hasher.finish();
}

}  // namespace

BinaryVocabulary plant(int branching, int levels, const std::vector<PlainNode>& plain) {
  // Children of each node in the order of the list: counted first, then laid side by side.
  std::vector<std::uint32_t> begin(plain.size() + 2, 0), child(plain.size());
  for (const PlainNode& node : plain) ++begin[node.parent + 1];
  for (std::size_t i = 1; i < begin.size(); ++i) begin[i] += begin[i - 1];
  std::vector<std::uint32_t> next(begin.begin(), begin.end() - 1);
  for (std::size_t i = 0; i < plain.size(); ++i) child[next[plain[i].parent]++] = static_cast<std::uint32_t>(i);

  auto tree = std::make_shared<BinaryVocabulary::Tree>();
  tree->branching = branching;
  tree->levels = levels;
  tree->nodes.reserve(plain.size());
  tree->descriptors.reserve(plain.size());
  std::vector<std::uint32_t> plain_of;  // of nodes, and the queue of those whose children are to come
  plain_of.reserve(plain.size());
  const auto take_children = [&](std::uint32_t number, std::uint32_t parent) {
    for (std::uint32_t i = begin[number]; i < begin[number + 1]; ++i) {
      const PlainNode& node = plain[child[i]];
      tree->nodes.push_back({parent, 0, 0, 0});
      tree->descriptors.push_back(node.descriptor);
      plain_of.push_back(child[i]);
      if (!node.leaf) continue;
      tree->nodes.back().word = static_cast<std::uint32_t>(tree->node_of_word.size());
      tree->node_of_word.push_back(static_cast<std::uint32_t>(tree->nodes.size() - 1));
      tree->weight_of_word.push_back(node.weight);
      tree->fixed_weight_of_word.push_back(static_cast<std::uint32_t>(std::lround(node.weight * 65536.0)));
    }
  };
  take_children(0, 0);
  tree->root_children = static_cast<std::uint32_t>(tree->nodes.size());
  for (std::size_t i = 0; i < plain_of.size(); ++i) {
    const auto first = static_cast<std::uint32_t>(tree->nodes.size());
    take_children(plain_of[i] + 1, static_cast<std::uint32_t>(i + 1));
    tree->nodes[i].first_child = first;
    tree->nodes[i].children = static_cast<std::uint32_t>(tree->nodes.size()) - first;
  }
  MAPWEAVE_EXPECT(tree->nodes.size() == plain.size() && !tree->node_of_word.empty(), "not a tree");
  tree->hash = hash_of(*tree);
  return BinaryVocabulary(std::move(tree));
}

int BinaryVocabulary::branching() const { return tree_->branching; }
int BinaryVocabulary::levels() const { return tree_->levels; }
std::size_t BinaryVocabulary::nodes() const { return tree_->nodes.size(); }
std::size_t BinaryVocabulary::words() const { return tree_->node_of_word.size(); }
double BinaryVocabulary::weight_of_word(std::uint32_t word) const { return tree_->weight_of_word.at(word); }
const OrbDescriptor& BinaryVocabulary::descriptor_of_word(std::uint32_t word) const {
  return tree_->descriptors[tree_->node_of_word.at(word)];
}
const OrbDescriptor& BinaryVocabulary::descriptor_of_node(std::uint32_t node) const {
  return tree_->descriptors.at(node);
}
const Hash& BinaryVocabulary::hash() const { return tree_->hash; }

BinaryVocabulary::WordAndNode BinaryVocabulary::find(const OrbDescriptor& descriptor, int direct_level) const {
  MAPWEAVE_EXPECT(direct_level >= 1, "the root is no node");
  std::uint32_t passed = 0;
  const std::uint32_t leaf =
      descend(descriptor, tree_->nodes.data(), tree_->descriptors.data(), tree_->root_children, direct_level, passed);
  return {tree_->nodes[leaf].word, passed};
}

DescribedPicture BinaryVocabulary::describe_picture(const std::vector<OrbDescriptor>& features,
                                                    int direct_level) const {
  DescribedPicture picture;
  picture.node_of_feature.reserve(features.size());
  std::vector<std::uint32_t> words;
  words.reserve(features.size());
  for (const OrbDescriptor& feature : features) {
    const WordAndNode place = find(feature, direct_level);
    picture.node_of_feature.push_back(place.node);
    if (tree_->fixed_weight_of_word[place.word] > 0) words.push_back(place.word);
  }
  std::sort(words.begin(), words.end());
  std::uint64_t total = 0;
  for (const std::uint32_t word : words) total += tree_->fixed_weight_of_word[word];
  for (std::size_t i = 0, end = 0; i < words.size(); i = end) {
    while (end < words.size() && words[end] == words[i]) ++end;
    const std::uint64_t weight = (end - i) * tree_->fixed_weight_of_word[words[i]];
    const std::uint64_t share = weight * kWholeBag / total;
    if (share > 0) picture.bag.push_back({words[i], static_cast<std::uint16_t>(share)});
  }
  return picture;
}

int common_share(const BagOfWords& a, const BagOfWords& b) {
  int common = 0;
  for (auto i = a.begin(), j = b.begin(); i != a.end() && j != b.end();) {
    if (i->word == j->word) {
      common += std::min(i->share, j->share);
      ++i;
      ++j;
    } else if (i->word < j->word) {
      ++i;
    } else {
      ++j;
    }
  }
  return common;
}

}  // namespace mapweave::matching
