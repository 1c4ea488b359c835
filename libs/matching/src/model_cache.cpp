#include <mapweave/matching/model_cache.h>

namespace mapweave::matching {

std::shared_ptr<const SubmapModel> ModelCache::get(const Submap& submap, const Table<NodeId, Node>& nodes) {
  {
    const std::lock_guard lock(mutex_);
    const auto found = entries_.find(submap.content);
    if (found != entries_.end()) {
      recent_.splice(recent_.begin(), recent_, found->second.place);
      return found->second.model;
    }
  }
  const auto model = std::make_shared<const SubmapModel>(submap, nodes);
  const std::lock_guard lock(mutex_);
  const auto found = entries_.find(submap.content);  // another thread may have been quicker
  if (found != entries_.end()) return found->second.model;
  recent_.push_front(submap.content);
  entries_[submap.content] = {model, recent_.begin()};
  bytes_ += model->bytes();
  while (bytes_ > most_bytes_ && recent_.size() > 1) {
    const auto oldest = entries_.find(recent_.back());
    bytes_ -= oldest->second.model->bytes();
    entries_.erase(oldest);
    recent_.pop_back();
  }
  return model;
}

std::shared_ptr<const SubmapModel> ModelCache::find(const Hash& content) {
  const std::lock_guard lock(mutex_);
  const auto found = entries_.find(content);
  return found != entries_.end() ? found->second.model : nullptr;
}

void ModelCache::clear() {
  const std::lock_guard lock(mutex_);
  entries_.clear();
  recent_.clear();
  bytes_ = 0;
}

}  // namespace mapweave::matching
