#pragma once
// Words of keyframes, found once for as long as somebody has the keyframe: speed, never content.

#include <mapweave/maps/map.h>
#include <mapweave/matching/binary_vocabulary.h>

#include <memory>
#include <mutex>
#include <unordered_map>

namespace mapweave::fusion {

struct OrderedPicture : matching::DescribedPicture {
  std::vector<std::uint32_t> by_node;  // matching::order_by_node()
};

// All calls are thread-safe, and all name the same vocabulary (contract).
class BagOfWordsCache {
 public:
  // The node is a keyframe.
  std::shared_ptr<const OrderedPicture> words_of(const Node&, const matching::BinaryVocabulary&);
  // Those of keyframes that nobody else has any more.
  void forget();

 private:
  struct Known {
    std::shared_ptr<const Payload> payload;
    std::shared_ptr<const OrderedPicture> words;
  };
  std::mutex mutex_;
  std::unordered_map<const Payload*, Known> known_;
};

}  // namespace mapweave::fusion
