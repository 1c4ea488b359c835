#pragma once
// The tree inside a vocabulary: nodes level by level, the children of a node side by side, so that descending reads
// little memory.

#include <mapweave/matching/binary_vocabulary.h>

namespace mapweave::matching {

struct VocabularyNode {
  std::uint32_t parent = 0;       // 0: the root, which is no node of the list; else index + 1
  std::uint32_t first_child = 0;  // index
  std::uint32_t children = 0;     // 0: a leaf
  std::uint32_t word = 0;         // of a leaf
};

struct BinaryVocabulary::Tree {
  int branching = 0, levels = 0;
  std::uint32_t root_children = 0;  // the first nodes
  std::vector<VocabularyNode> nodes;
  std::vector<OrbDescriptor> descriptors;  // of nodes
  std::vector<std::uint32_t> node_of_word;
  std::vector<double> weight_of_word;
  std::vector<std::uint32_t> fixed_weight_of_word;  // in 1/65536: all sums are of integers
  Hash hash;
};

// A node as files and training bring it: parents before children, in any other order.
struct PlainNode {
  std::uint32_t parent = 0;  // 0: root, else place in the list + 1, less than its own
  bool leaf = false;
  OrbDescriptor descriptor{};
  double weight = 0.0;
};

// Puts nodes into the tree's order, numbers the words, hashes. The nodes must form a sound tree.
BinaryVocabulary plant(int branching, int levels, const std::vector<PlainNode>& nodes);

}  // namespace mapweave::matching
