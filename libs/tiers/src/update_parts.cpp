#include "update_parts.h"

#include <mapweave/core/error.h>

#include <algorithm>
#include <tuple>

namespace mapweave::tiers {
namespace {

// About what they take in an encoded update: where to cut, not whether.
constexpr std::size_t kKeyframeBytes = 200, kLandmarkBytes = 60, kSightingBytes = 14, kMovedBytes = 90,
                      kRemovedBytes = 20;

class Cutter {
 public:
  Cutter(const MapUpdate& update, std::size_t most_bytes)
      : update_(update), most_bytes_(most_bytes), base_(update.base), sequence_(update.sequence) {
    for (std::size_t i = 0; i < update.moved.size(); ++i) pieces_.push_back({0, Kind::moved, i, kMovedBytes});
    for (std::size_t i = 0; i < update.nodes.size(); ++i) {
      const KeyframeFeatures* keyframe = keyframe_of(update.nodes[i]);
      pieces_.push_back(
          {i + 1, Kind::node, i,
           kKeyframeBytes + kFeatureBytes * (keyframe != nullptr ? keyframe->points.size() : std::size_t{0})});
    }
    for (std::size_t i = 0; i < update.landmarks.size(); ++i) {
      const Landmark& landmark = update.landmarks[i];
      pieces_.push_back(
          {std::max(place_of(landmark.anchor), place_of(landmark.seen)), Kind::landmark, i, bytes_of(landmark.seen)});
    }
    add(update.changed_landmarks, Kind::changed_landmark);
    add(update.borrowed, Kind::borrowed);
    const std::size_t last = update.nodes.size() + 1;
    for (std::size_t i = 0; i < update.removed_landmarks.size(); ++i)
      pieces_.push_back({last, Kind::removed_landmark, i, kRemovedBytes});
    for (std::size_t i = 0; i < update.removed_nodes.size(); ++i)
      pieces_.push_back({last, Kind::removed_node, i, kRemovedBytes});
    // Known before, and first: landmarks that are sent as a whole keep what forgotten keyframes saw of them, and
    // forgotten landmarks may hang on keyframes that are removed.
    for (std::size_t i = 0; i < update.forgotten_nodes.size(); ++i)
      pieces_.push_back({0, Kind::forgotten_node, i, kRemovedBytes});
    for (std::size_t i = 0; i < update.forgotten_landmarks.size(); ++i)
      pieces_.push_back({0, Kind::forgotten_landmark, i, kRemovedBytes});
    std::sort(pieces_.begin(), pieces_.end(), [](const Piece& a, const Piece& b) {
      return std::tie(a.place, a.kind, a.index) < std::tie(b.place, b.kind, b.index);
    });
  }

  std::vector<std::string> parts() && {
    cut(0, pieces_.size());
    return std::move(parts_);
  }

 private:
  enum class Kind {
    moved,
    node,
    landmark,
    changed_landmark,
    borrowed,
    removed_landmark,
    removed_node,
    forgotten_node,
    forgotten_landmark
  };
  struct Piece {
    std::size_t place;  // 0: needs no new keyframe; else it belongs to the new keyframe of this number, counted from 1;
                        // one more: comes last
    Kind kind;
    std::size_t index;  // in its list
    std::size_t bytes;
  };

  std::size_t place_of(const NodeId& id) const {
    const auto found = std::lower_bound(update_.nodes.begin(), update_.nodes.end(), id,
                                        [](const Node& node, const NodeId& wanted) { return node.id < wanted; });
    return found != update_.nodes.end() && found->id == id ? static_cast<std::size_t>(found - update_.nodes.begin()) + 1
                                                           : 0;
  }
  std::size_t place_of(const std::vector<LandmarkSighting>& seen) const {
    std::size_t last = 0;
    for (const LandmarkSighting& sighting : seen) last = std::max(last, place_of(sighting.node));
    return last;
  }
  static std::size_t bytes_of(const std::vector<LandmarkSighting>& seen) {
    return kLandmarkBytes + kSightingBytes * seen.size();
  }
  void add(const std::vector<LandmarkChange>& changes, Kind kind) {
    for (std::size_t i = 0; i < changes.size(); ++i)
      pieces_.push_back({place_of(changes[i].seen), kind, i, bytes_of(changes[i].seen)});
  }

  // Places rise within each list, but where landmarks stand between others' keyframes: they are sorted again.
  MapUpdate part(std::size_t begin, std::size_t end) const {
    MapUpdate part;
    part.origin = update_.origin;
    part.base = base_;
    part.sequence = sequence_;
    for (std::size_t i = begin; i < end; ++i) {
      const std::size_t from = pieces_[i].index;
      switch (pieces_[i].kind) {
        case Kind::moved: part.moved.push_back(update_.moved[from]); break;
        case Kind::node: part.nodes.push_back(update_.nodes[from]); break;
        case Kind::landmark: part.landmarks.push_back(update_.landmarks[from]); break;
        case Kind::changed_landmark: part.changed_landmarks.push_back(update_.changed_landmarks[from]); break;
        case Kind::borrowed: part.borrowed.push_back(update_.borrowed[from]); break;
        case Kind::removed_landmark: part.removed_landmarks.push_back(update_.removed_landmarks[from]); break;
        case Kind::removed_node: part.removed_nodes.push_back(update_.removed_nodes[from]); break;
        case Kind::forgotten_node: part.forgotten_nodes.push_back(update_.forgotten_nodes[from]); break;
        case Kind::forgotten_landmark: part.forgotten_landmarks.push_back(update_.forgotten_landmarks[from]); break;
      }
    }
    const auto by_id = [](const auto& a, const auto& b) { return a.id < b.id; };
    std::sort(part.landmarks.begin(), part.landmarks.end(), by_id);
    std::sort(part.changed_landmarks.begin(), part.changed_landmarks.end(), by_id);
    std::sort(part.borrowed.begin(), part.borrowed.end(), by_id);
    return part;
  }

  void cut(std::size_t begin, std::size_t end) {
    std::size_t all = 0;
    for (std::size_t i = begin; i < end; ++i) all += pieces_[i].bytes;
    if (end - begin <= 1 || all <= 2 * most_bytes_) {
      std::string bytes = encode(part(begin, end));
      if (end - begin <= 1 || bytes.size() <= most_bytes_) {
        parts_.push_back(std::move(bytes));
        base_ = sequence_++;
        return;
      }
    }
    std::size_t middle = begin + 1;
    for (std::size_t bytes = pieces_[begin].bytes; middle + 1 < end && 2 * bytes < all; ++middle)
      bytes += pieces_[middle].bytes;
    cut(begin, middle);
    cut(middle, end);
  }

  const MapUpdate& update_;
  const std::size_t most_bytes_;
  std::uint64_t base_, sequence_;
  std::vector<Piece> pieces_;
  std::vector<std::string> parts_;
};

}  // namespace

std::vector<std::string> encoded_in_parts(const MapUpdate& update, std::size_t most_bytes) {
  MAPWEAVE_EXPECT(update.submaps.empty() && update.constraints.empty() && update.judgements.empty() &&
                      update.removed_submaps.empty() && update.removed_constraints.empty(),
                  "a camera's update");
  return Cutter(update, most_bytes).parts();
}

}  // namespace mapweave::tiers
