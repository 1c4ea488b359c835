#pragma once
// One origin's updates, stored in the order of their numbers whatever order they come in.

#include <mapweave/maps/receipt.h>

#include <atomic>
#include <map>
#include <memory>
#include <set>
#include <string>
#include <vector>

namespace mapweave::tiers {

class UpdateInbox {
 public:
  // Of updates that wait for a missing one; more are dropped, and will be awaited.
  static constexpr std::size_t kMostWaiting = 1024, kMostWaitingBytes = std::size_t{64} << 20;
  explicit UpdateInbox(Origin origin);
  UpdateInbox(UpdateInbox&&) = default;
  UpdateInbox& operator=(UpdateInbox&&) = default;

  // What could be stored now, in order; nothing for one that came before, or that has to wait. One that builds on
  // nothing may have any number after those: it says all up to there, in place of what was there. Throws
  // Error(kBadInput) for one that does not fit what it builds on, of which nothing is stored then; one that waited and
  // does not fit is dropped, and will be awaited. `bytes`: of the update as it came. most_waiting_bytes: that may wait
  // here now, if less than kMostWaitingBytes.
  std::vector<MapUpdate> receive(MapUpdate update, std::size_t bytes, const std::string& where,
                                 std::size_t most_waiting_bytes = kMostWaitingBytes);
  std::size_t waiting_bytes() const { return waiting_bytes_; }  // with what keeping each one takes
  void drop_waiting() {
    waiting_.clear();
    waiting_bytes_ = 0;
  }  // they will be awaited

  // Changes when an update is stored.
  const Map& map() const { return kept_->map; }
  // The map as it is now; what comes later changes another one. Read and let go of on any thread. While it is held the
  // next update to be stored copies the map, once.
  std::shared_ptr<const Map> snapshot() const;

  // Of the map: what the sender no longer has (MapUpdate::forgotten_nodes). Landmarks that it has still keep what such
  // keyframes saw of them.
  const std::set<NodeId>& forgotten_nodes() const { return forgotten_nodes_; }
  const std::set<LandmarkId>& forgotten_landmarks() const { return forgotten_landmarks_; }
  // Forgotten keyframes (contract), ascending, with the landmarks that hang on them and what they saw of others: as an
  // update that builds on nothing.
  MapUpdate content_of(const std::vector<NodeId>& nodes) const;
  // Takes the same out of the map.
  void take_out(const std::vector<NodeId>& nodes);
  // Those that were taken out, and where they lie now.
  const std::map<NodeId, Pose3>& taken_out() const { return taken_out_; }

  Receipt receipt() const { return {origin_, stored_, waiting_.empty() ? 0 : stored_ + 1}; }

 private:
  void store(const MapUpdate& update);
  void apply_here(const MapUpdate& update);
  bool concerns_forgotten(const MapUpdate& update) const;
  MapUpdate fitted(MapUpdate update) const;
  std::set<LandmarkId> hanging_on(const std::vector<NodeId>& nodes) const;
  void note_forgotten(const MapUpdate& update);
  Origin origin_;
  struct Kept {
    Map map;
    std::atomic<int> held{0};  // snapshots
  };
  std::shared_ptr<Kept> kept_;
  LandmarksByNode hanging_;  // of the map
  std::set<NodeId> forgotten_nodes_;
  std::set<LandmarkId> forgotten_landmarks_;
  std::map<NodeId, Pose3> taken_out_;
  std::uint64_t stored_ = 0;
  struct EarlyUpdate {
    MapUpdate update;
    std::size_t bytes;
  };
  std::map<std::uint64_t, EarlyUpdate> waiting_;
  std::size_t waiting_bytes_ = 0;
};

}  // namespace mapweave::tiers
