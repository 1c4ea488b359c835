#pragma once
// What a user asks of a merge beside its maps: robots left out, pairs excluded, priors.

#include <mapweave/fusion/fuse.h>
#include <mapweave/runtime/run_configuration.h>
#include <mapweave/runtime/team_frame.h>

#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace mapweave::runtime {

struct Anchor {
  std::string a, b;  // names of maps or robots
  Pose2 a_from_b;    // b's map frame in a's
  double sigma_m = kStartSigma_m, sigma_rad = 0.1;
};

struct MergeRequests {
  std::vector<std::string> without;                          // maps or robots to leave out
  std::vector<std::pair<std::string, std::string>> refused;  // pairs of maps or robots never to be matched
  std::vector<Anchor> anchors;                               // priors of users
  std::set<Hash> vetoed = {};                                // judgements not to be believed
};

inline constexpr const char *kRefuseFlag = "--refuse", *kVetoFlag = "--veto";

// 64 digits; nullopt for anything else.
std::optional<Hash> hash_in_hex(std::string_view text);
// As merges.json writes it. Throws Error(kUsage) for anything else.
Hash parse_veto(std::string_view text);

// "A,B". Throws Error(place.code) for anything else.
std::pair<std::string, std::string> parse_pair(std::string_view text,
                                               const RequestPlace& place = {ErrorCode::kUsage, kRefuseFlag});

// "A,B,x,y,yaw[,sigma[,sigma_yaw]]": metres and radians. Throws Error(kUsage) for anything else.
Anchor parse_anchor(std::string_view text);

// The maps without those named, by map or robot. Throws Error(kUsage), with
// the names there are, for a name of neither, or where nothing would be left.
std::vector<Map> without(std::vector<Map> maps, const std::vector<std::string>& names);
// Puts the other requests into the input, whose maps are those that were left. Throws Error(kUsage) as without(), for a
// pair of one map, and for two anchors of one pair. `refused_at`: where the refused pairs stand.
void apply(const MergeRequests&, fusion::FusionInput&, const std::string& refused_at = kRefuseFlag);

// A robot's own map, and where its log began.
struct StartedMap {
  const Map* map;
  StartPose start;
};
// Of each two maps whose starts are known.
std::vector<fusion::MapPrior> priors_of_starts(const std::vector<StartedMap>&);
// A note where the start of only one of several maps is known.
std::optional<std::string> start_alone(const std::vector<StartedMap>&);

}  // namespace mapweave::runtime
