#pragma once
// Which keyframes look like this one? An inverted index from words to the keyframes that show them (CORB-SLAM 2.2,
// keyframe database).

#include <mapweave/core/ids.h>
#include <mapweave/maps/table.h>
#include <mapweave/matching/binary_vocabulary.h>

#include <functional>
#include <vector>

namespace mapweave::matching {

struct SimilarPlace {
  NodeId id;
  int score = 0;  // common_share() of the two bags, 0 .. kWholeBag
};

// Scores are integers and results are ordered by them, then by id: nothing depends on the order in which keyframes came
// or went. Not thread-safe while it changes; const calls are.
class PlaceIndex {
 public:
  explicit PlaceIndex(std::size_t words);  // of the vocabulary

  void add(const NodeId& id, const BagOfWords& bag);  // id: not in it yet
  bool remove(const NodeId& id);                      // whether it was there
  bool contains(const NodeId& id) const { return slots_.contains(id); }
  std::size_t size() const { return slots_.size(); }
  std::size_t bytes() const;  // held

  // The `most` best of those that `excluded` does not name and that share at least `least_score`, best first; of equals
  // the lower id.
  std::vector<SimilarPlace> query(const BagOfWords& bag, std::size_t most,
                                  const std::function<bool(const NodeId&)>& excluded = {}, int least_score = 1) const;

 private:
  struct Posting {
    std::uint16_t slot, share;  // slot within its block
  };
  // 65536 slots, so that a posting takes four bytes.
  struct Block {
    std::vector<std::vector<Posting>> postings;  // by word
  };
  static void accumulate(const std::vector<Posting>& postings, std::uint16_t share, std::uint16_t* scores);
  void append(std::uint32_t slot, const BagOfWords& bag);
  void compact();

  std::size_t words_;
  Table<NodeId, std::uint32_t> slots_;
  std::vector<NodeId> id_of_slot_;
  std::vector<bool> alive_;
  std::vector<Block> blocks_;
};

// Keyframes that see the same landmarks speak for each other (ORB-SLAM, Mur-Artal et al., IEEE T-RO 31(5), 2015,
// section V-E): each result's score is summed over those of its covisible keyframes that are results too; of groups
// within `share_of_best` of the best sum, the best member is answered once. Best sum first; of equals the lower id.
// `score` holds the sum.
std::vector<SimilarPlace> best_of_groups(const std::vector<SimilarPlace>& places,
                                         const std::function<std::vector<NodeId>(const NodeId&)>& covisible,
                                         double share_of_best = 0.75);

}  // namespace mapweave::matching
