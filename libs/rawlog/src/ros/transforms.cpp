#include "transforms.h"

#include <algorithm>
#include <cmath>
#include <cstdio>

namespace mapweave::rawlog::ros {
namespace {

constexpr std::int64_t kKept_ns = 30'000'000'000, kReach_ns = 500'000'000;
constexpr std::size_t kMostLinks = 4096;  // of a robot: some tens
constexpr double kSame_m = 1e-6, kSame_rad = 1e-6;

bool is_same(const Pose3& a, const Pose3& b) {
  return (a.t - b.t).norm() < kSame_m && a.q.angularDistance(b.q) < kSame_rad;
}

Pose3 interpolated(const Pose3& a, const Pose3& b, double part) {
  return {a.t + part * (b.t - a.t), a.q.slerp(part, b.q).normalized()};
}

}  // namespace

std::string seconds_text(std::int64_t stamp_ns) {
  char text[40];
  std::snprintf(text, sizeof text, "%.3f s", static_cast<double>(stamp_ns) * 1e-9);
  return text;
}

std::string frame_name(std::string_view frame_id) {
  if (!frame_id.empty() && frame_id.front() == '/') frame_id.remove_prefix(1);
  return std::string(frame_id);
}

void TransformBuffer::add(const std::string& parent, const std::string& child, std::int64_t stamp_ns,
                          const Pose3& parent_from_child, bool is_static) {
  if (links_.size() >= kMostLinks && links_.count(child) == 0) return;
  Link& link = links_[child];
  if (link.parent != parent) link = Link{parent, is_static, false, {}};
  link.is_static = is_static;
  if (is_static) link.poses.clear();
  if (!link.poses.empty() && !is_same(link.poses.begin()->second, parent_from_child)) link.has_moved = true;
  // Of a link that stands still one pose is enough, with the stamps between which it stood.
  if (!link.has_moved && link.poses.size() > 1 && stamp_ns > link.poses.rbegin()->first)
    link.poses.erase(std::prev(link.poses.end()));
  link.poses[stamp_ns] = parent_from_child;
  while (link.poses.begin()->first < stamp_ns - kKept_ns && link.has_moved) link.poses.erase(link.poses.begin());
}

bool TransformBuffer::knows(const std::string& frame) const {
  return links_.count(frame) != 0 ||
         std::any_of(links_.begin(), links_.end(), [&](const auto& link) { return link.second.parent == frame; });
}

std::string TransformBuffer::frames() const {
  std::string text;
  for (const auto& [child, link] : links_) text += (text.empty() ? "" : ", ") + link.parent + " -> " + child;
  return text;
}

TransformBuffer::Chain TransformBuffer::chain_of(const std::string& frame) const {
  Chain chain{{frame}, false};
  for (auto link = links_.find(frame); link != links_.end(); link = links_.find(chain.frames.back())) {
    chain.is_loop = std::find(chain.frames.begin(), chain.frames.end(), link->second.parent) != chain.frames.end();
    chain.frames.push_back(link->second.parent);
    if (chain.is_loop) break;
  }
  return chain;
}

TransformAnswer TransformBuffer::pose_of(const std::string& child, std::int64_t stamp_ns, bool is_final) const {
  const Link& link = links_.at(child);
  const auto &first = *link.poses.begin(), &last = *link.poses.rbegin();
  if (link.is_static || !link.has_moved) return {first.second, {}, false};
  const std::string name = "the link '" + link.parent + "' -> '" + child + "'";
  if (stamp_ns < first.first) {
    if (first.first - stamp_ns <= kReach_ns) return {first.second, {}, false};
    return {std::nullopt, name + " is known since " + seconds_text(first.first) + " only", true};
  }
  if (stamp_ns > last.first) {
    if (is_final && stamp_ns - last.first <= kReach_ns) return {last.second, {}, false};
    return {std::nullopt, name + " is known until " + seconds_text(last.first) + " only", false};
  }
  const auto after = link.poses.lower_bound(stamp_ns);
  if (after->first == stamp_ns) return {after->second, {}, false};
  const auto before = std::prev(after);
  return {
      interpolated(before->second, after->second,
                   static_cast<double>(stamp_ns - before->first) / static_cast<double>(after->first - before->first)),
      {},
      false};
}

TransformAnswer TransformBuffer::find(const std::string& target, const std::string& source, std::int64_t stamp_ns,
                                      bool is_final) const {
  const Chain up = chain_of(source), down = chain_of(target);
  for (const Chain* chain : {&up, &down}) {
    if (!chain->is_loop) continue;
    std::string loop;
    for (const std::string& frame : chain->frames) loop += (loop.empty() ? "'" : " -> '") + frame + "'";
    return {std::nullopt, "the parents of its frames are a loop: " + loop, false};
  }
  const auto common = std::find_first_of(up.frames.begin(), up.frames.end(), down.frames.begin(), down.frames.end());
  if (common == up.frames.end()) {
    const std::string& root = knows(source) ? up.frames.back() : source;
    return {std::nullopt,
            knows(root) ? "the frame '" + root + "' has no parent" : "the frame '" + root + "' is in no transform",
            false};
  }
  const auto climbed = [&](const Chain& chain) -> TransformAnswer {  // common_from_frame
    Pose3 pose;
    for (const std::string& frame : chain.frames) {
      if (frame == *common) break;
      const TransformAnswer link = pose_of(frame, stamp_ns, is_final);
      if (!link.pose) return link;
      pose = compose(*link.pose, pose);
    }
    return {pose, {}, false};
  };
  const TransformAnswer common_from_source = climbed(up);
  if (!common_from_source.pose) return common_from_source;
  const TransformAnswer common_from_target = climbed(down);
  if (!common_from_target.pose) return common_from_target;
  return {between(*common_from_target.pose, *common_from_source.pose), {}, false};
}

}  // namespace mapweave::rawlog::ros
