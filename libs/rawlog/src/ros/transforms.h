#pragma once
// How frames stand to each other, as tf says it: http://wiki.ros.org/tf2

#include <mapweave/core/geometry.h>

#include <cstdint>
#include <deque>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace mapweave::rawlog::ros {

std::string seconds_text(std::int64_t stamp_ns);  // with its unit

// A frame's name without the slash before it that old programs write.
std::string frame_name(std::string_view frame_id);

struct TransformAnswer {
  std::optional<Pose3> pose;
  std::string why_not;           // names the link or frame that is missing; empty where there is a pose
  bool is_before_first = false;  // the link is known later
};

// Links between frames as they come, each kept for a while; a link that has not moved yet counts as fixed. For one
// thread.
class TransformBuffer {
 public:
  // Stamps of one link may be out of order. A child that gets another parent follows the new one from then on.
  void add(const std::string& parent, const std::string& child, std::int64_t stamp_ns, const Pose3& parent_from_child,
           bool is_static);

  // target_from_source at a stamp, over any chain of links. A link that moves is interpolated; up to half a second
  // beyond what is known of it the nearest pose is taken where `is_final`: nothing more will come.
  TransformAnswer find(const std::string& target, const std::string& source, std::int64_t stamp_ns,
                       bool is_final) const;

  bool knows(const std::string& frame) const;  // as a parent or a child
  bool empty() const { return links_.empty(); }
  std::string frames() const;  // "odom -> base_link, base_link -> laser"

 private:
  struct Link {
    std::string parent;
    bool is_static = false, has_moved = false;
    std::map<std::int64_t, Pose3> poses;  // by stamp
  };
  struct Chain {
    std::vector<std::string> frames;  // from the frame itself to its root
    bool is_loop = false;
  };
  Chain chain_of(const std::string& frame) const;
  TransformAnswer pose_of(const std::string& child, std::int64_t stamp_ns, bool is_final) const;

  std::map<std::string, Link> links_;  // by child
};

}  // namespace mapweave::rawlog::ros
