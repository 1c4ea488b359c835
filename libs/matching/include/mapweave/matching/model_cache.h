#pragma once
// Submap models, made when asked for and kept while there is room: memory stays bounded, results do not depend on it.

#include <mapweave/matching/submap_model.h>

#include <cstddef>
#include <list>
#include <map>
#include <memory>
#include <mutex>

namespace mapweave::matching {

class ModelCache {
 public:
  explicit ModelCache(std::size_t most_bytes) : most_bytes_(most_bytes) {}
  // Thread-safe; `nodes` must not change meanwhile. Keyed by the submap's content.
  std::shared_ptr<const SubmapModel> get(const Submap& submap, const Table<NodeId, Node>& nodes);
  std::shared_ptr<const SubmapModel> find(const Hash& content);  // none where it is not kept

  void clear();  // gives its memory back

 private:
  struct CachedModel {
    std::shared_ptr<const SubmapModel> model;
    std::list<Hash>::iterator place;
  };
  std::size_t most_bytes_, bytes_ = 0;
  std::mutex mutex_;
  std::map<Hash, CachedModel> entries_;
  std::list<Hash> recent_;  // newest first
};

}  // namespace mapweave::matching
