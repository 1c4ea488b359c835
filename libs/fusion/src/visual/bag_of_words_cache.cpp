#include <mapweave/fusion/bag_of_words_cache.h>
#include <mapweave/matching/feature_matching.h>

namespace mapweave::fusion {

std::shared_ptr<const OrderedPicture> BagOfWordsCache::words_of(const Node& node,
                                                                const matching::BinaryVocabulary& vocabulary) {
  {
    const std::lock_guard lock(mutex_);
    if (const auto known = known_.find(node.payload.get()); known != known_.end()) return known->second.words;
  }
  auto words = std::make_shared<OrderedPicture>();
  static_cast<matching::DescribedPicture&>(*words) = vocabulary.describe_picture(keyframe_of(node)->descriptors);
  words->by_node = matching::order_by_node(words->node_of_feature.data(), words->node_of_feature.size());
  const std::lock_guard lock(mutex_);
  return known_.try_emplace(node.payload.get(), Known{node.payload, std::move(words)}).first->second.words;
}

void BagOfWordsCache::forget() {
  const std::lock_guard lock(mutex_);
  for (auto one = known_.begin(); one != known_.end();)
    one = one->second.payload.use_count() == 1 ? known_.erase(one) : std::next(one);
}

}  // namespace mapweave::fusion
