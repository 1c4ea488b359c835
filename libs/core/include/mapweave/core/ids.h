#pragma once
// Names of things. They say who owns what they name and never change: no merge renumbers anything.

#include <cstdint>
#include <functional>
#include <string>
#include <string_view>
#include <tuple>

namespace mapweave {

// A short text kept once per process, so that a copy is a pointer and equality costs nothing. Ordered by its letters.
// Thread-safe. What is interned stays until the process ends: for names of robots, sensors, edges and maps, of which
// there are few. Tag makes kinds of names different types.
template <class Tag>
class Name {
 public:
  Name() : text_(intern({})) {}
  explicit Name(std::string_view text) : text_(intern(text)) {}
  const std::string& str() const { return *text_; }
  bool empty() const { return text_->empty(); }
  friend bool operator==(Name a, Name b) { return a.text_ == b.text_; }
  friend bool operator!=(Name a, Name b) { return a.text_ != b.text_; }
  friend bool operator<(Name a, Name b) { return a.text_ != b.text_ && *a.text_ < *b.text_; }

 private:
  static const std::string* intern(std::string_view text);
  const std::string* text_;
};

struct RobotTag;
struct SensorTag;
struct TierTag;
struct MapTag;
extern template class Name<RobotTag>;
extern template class Name<SensorTag>;
extern template class Name<TierTag>;
extern template class Name<MapTag>;

using RobotId = Name<RobotTag>;    // "alpha"
using SensorId = Name<SensorTag>;  // "laser", "camera_left"
using TierId = Name<TierTag>;      // an edge, "cloud", or a robot's name where it maps on board
using MapId = Name<MapTag>;        // what a verdict speaks of: a robot's map in `run`, a file's stem in `merge`

// One laser or one camera (or stereo pair, or RGB-D sensor) of a robot.
struct ClientId {
  RobotId robot;
  SensorId sensor;
};

// One client's one run. `run` tells runs of one client apart: nanoseconds since the UNIX epoch of the first
// observation.
struct SessionId {
  ClientId client;
  std::int64_t run = 0;
};

struct NodeId {
  SessionId session;
  std::uint32_t index = 0;  // counts from 0 within the session
};

struct SubmapId {
  SessionId session;
  std::uint32_t index = 0;
};

inline auto key_of(const ClientId& id) { return std::tie(id.robot, id.sensor); }
inline auto key_of(const SessionId& id) { return std::tie(id.client.robot, id.client.sensor, id.run); }
inline auto key_of(const NodeId& id) {
  return std::tie(id.session.client.robot, id.session.client.sensor, id.session.run, id.index);
}
inline auto key_of(const SubmapId& id) {
  return std::tie(id.session.client.robot, id.session.client.sensor, id.session.run, id.index);
}

// Ids compare by robot name, sensor name, run, index: the canonical order of everything.
template <class Id, class = decltype(key_of(std::declval<const Id&>()))>
bool operator<(const Id& a, const Id& b) {
  return key_of(a) < key_of(b);
}
template <class Id, class = decltype(key_of(std::declval<const Id&>()))>
bool operator==(const Id& a, const Id& b) {
  return key_of(a) == key_of(b);
}
template <class Id, class = decltype(key_of(std::declval<const Id&>()))>
bool operator!=(const Id& a, const Id& b) {
  return !(a == b);
}

std::string to_string(const SessionId&);  // "alpha/laser@976052857.217"
std::string to_string(const NodeId&);     // ".../node 17"
std::string to_string(const SubmapId&);   // ".../submap 3"

// True for a name that can be a robot, sensor, edge or map: 1 to 64 of letters, digits, '_', '-', '.', not starting
// with '.', so that it can be a folder.
bool is_valid_name(std::string_view text);

}  // namespace mapweave
