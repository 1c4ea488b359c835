#pragma once
// A tree of binary words (Galvez-Lopez, Tardos: Bags of Binary Words for Fast Place Recognition in Image Sequences,
// IEEE T-RO 28(5), 2012): descriptors fall through it to a leaf, their word. Words that many pictures share say little
// and weigh little (tf-idf).

#include <mapweave/core/hash.h>
#include <mapweave/core/options.h>
#include <mapweave/core/progress.h>
#include <mapweave/matching/orb_descriptor.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace mapweave::matching {

// A picture's words with their share of the whole, in 1/65535, by rising word. Shares are rounded down, so they add up
// to 65535 at most.
struct WordShare {
  std::uint32_t word = 0;
  std::uint16_t share = 0;
};
using BagOfWords = std::vector<WordShare>;
inline constexpr int kWholeBag = 65535;

// What two pictures have in common: the sum of the lesser shares, 0 .. kWholeBag. Of bags as vectors v, w of L1 length
// 1 that is 1 - |v - w| / 2, the score of the paper's equation 2. Words of weight 0 are in no bag.
int common_share(const BagOfWords& a, const BagOfWords& b);

struct DescribedPicture {
  BagOfWords bag;
  std::vector<std::uint32_t>
      node_of_feature;  // direct index: the tree's node at `direct_level` that each feature fell through
};

// Immutable; a copy shares its nodes. Safe to use from several threads.
class BinaryVocabulary {
 public:
  struct WordAndNode {
    std::uint32_t word, node;
  };
  int branching() const;      // most children of a node
  int levels() const;         // deepest leaf allowed, counted from 1 below the root
  std::size_t nodes() const;  // without the root
  std::size_t words() const;
  double weight_of_word(std::uint32_t word) const;  // inverse document frequency, ln(pictures / pictures with the word)
  const OrbDescriptor& descriptor_of_word(std::uint32_t word) const;
  const OrbDescriptor& descriptor_of_node(std::uint32_t node) const;

  // node: at `direct_level` below the root, or the leaf where that is less deep. Ties go to the child that comes first.
  WordAndNode find(const OrbDescriptor&, int direct_level) const;
  DescribedPicture describe_picture(const std::vector<OrbDescriptor>& features, int direct_level = kDirectLevel) const;
  static constexpr int kDirectLevel = 2;

  // Of shape, descriptors and weights, whatever order a file had them in.
  const Hash& hash() const;

  struct Tree;
  explicit BinaryVocabulary(std::shared_ptr<const Tree> tree) : tree_(std::move(tree)) {}
  const Tree& tree() const { return *tree_; }

 private:
  std::shared_ptr<const Tree> tree_;
};

// The text layout of DBoW2 as ORB-SLAM2 writes it, gz or plain: "k L 0 0" (0 0: L1 score, tf-idf), then a line for each
// node, numbered from 1: "parent leaf d0 .. d31 weight". A parent comes before its children. Throws Error: kMissing,
// kCorrupt (with the line) for anything else than such a tree, kUnsupported for other scores or weights and for more
// nodes than `kMostVocabularyNodes`.
inline constexpr std::size_t kMostVocabularyNodes = 4'000'000;
BinaryVocabulary load_vocabulary(const std::filesystem::path&);
BinaryVocabulary parse_vocabulary(std::string_view bytes, const std::string& where);
// The one that mapweave brings (datasets/vocabulary), part of the program: 10000 words of OpenCV's ORB. Read at the
// first call; thread-safe.
const BinaryVocabulary& shipped_vocabulary();
// What a camera client, a map server or a merge describes places with: the vocabulary that it was given, else the
// shipped one, which is read when it is first needed.
class ChosenVocabulary {
 public:
  ChosenVocabulary() = default;
  explicit ChosenVocabulary(BinaryVocabulary given) : given_(std::move(given)) {}
  const BinaryVocabulary& get() const { return given_ ? *given_ : shipped_vocabulary(); }
  bool is_given() const { return given_.has_value(); }

 private:
  std::optional<BinaryVocabulary> given_;
};

// gz, nodes level by level. Loading it again gives the same hash. Throws Error kCannotWrite.
void save_vocabulary(const BinaryVocabulary&, const std::filesystem::path&);

struct VocabularyOptions {
  int branching = 10;
  int levels = 4;
  std::uint64_t seed = 1;
  int iterations = 25;
  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("branching", branching, 2, 32,
              "most children of a node of the vocabulary's tree; larger values give more words, which tell more "
              "features apart");
    v.integer("levels", levels, 1, 8,
              "most levels of the vocabulary's tree; larger values give more words, which tell more features apart");
    v.integer("seed", seed, 0, 4294967295,
              "seed of the random centres that clustering begins with; the same seed gives the same vocabulary");
    v.integer("iterations", iterations, 1, 1000,
              "most iterations of k-medians in one node; larger values are slower and change nothing once they have "
              "converged");
  }
};

// Descriptors of many pictures, one picture after the other.
struct VocabularyPictures {
  std::vector<OrbDescriptor> descriptors;
  std::vector<std::size_t> ends;  // of each picture in `descriptors`
  void add(const std::vector<OrbDescriptor>& picture) {
    descriptors.insert(descriptors.end(), picture.begin(), picture.end());
    ends.push_back(descriptors.size());
  }
};

// Hierarchical k-medians in Hamming space, k-means++ for the first centres; words are weighed by the pictures they are
// seen in. Throws Error kBadInput where there is no descriptor.
BinaryVocabulary train_vocabulary(const VocabularyPictures&, const VocabularyOptions&, Progress&);

}  // namespace mapweave::matching
