#pragma once
// Maps as they were given to run or merge: the frame of one of them becomes a team's.

#include <mapweave/fusion/fuse.h>
#include <mapweave/runtime/team_frame.h>

#include <map>
#include <string>
#include <utility>
#include <vector>

namespace mapweave::runtime {

struct GivenMap {
  std::string name;
  MapIdentity identity = {};  // of its store; version 0: it has none
  // Robots' own maps that it holds, first the one by which it got its frame. Of their nodes, by their places in the own
  // map (names may change, the order does not): where the given map has them.
  struct Member {
    MapId map;
    std::vector<std::pair<std::size_t, Pose3>> poses;
  };
  std::vector<Member> members;
};
GivenMap given_map(const Map& own, const std::string& name, const MapIdentity& identity = {});

// By which a frame can be asked for: `names`, and those of what was given, of its maps, and of their robots.
std::vector<std::string> with_names_of(const std::vector<GivenMap>& given, const std::vector<Map>& maps,
                                       std::vector<std::string> names = {});

// What was given, in that order, and what was asked for.
struct FrameChoice {
  FrameRequest request;
  std::vector<GivenMap> given;
};

// What a store says of the frame and of the identity of its map.
void keep(const TeamFrame&, std::map<std::string, std::string>& metadata);
void keep(const MapIdentity&, std::map<std::string, std::string>& metadata);
// The own map by which the store's map got its frame; empty where it does not say.
MapId frame_kept_by(const std::map<std::string, std::string>& metadata);
// Of a new map where `continued` is none; its id is made of its content then.
MapIdentity next_version(const MapIdentity& continued, const Hash& content);

// Moves each team of the result into the frame that it is to have, and says which: that of the map that was named,
// where the team has a part of it, else of the first map given that it has a part of. The first place of that map stays
// where it was given. `own`: all maps that were fused.
std::vector<TeamFrame> choose_frames(const FrameChoice&, const std::vector<const Map*>& own, fusion::FusionResult&);

}  // namespace mapweave::runtime
