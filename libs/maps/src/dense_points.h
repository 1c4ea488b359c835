#pragma once
// Points of a keyframe in as few bits as they need: about 5 bytes of each, instead of 8. Nothing is lost.
//
// A stream of bits, the lowest of each byte first. Its head: for u, v, inverse depth, level and angle how many of the
// lowest bits are zero in all points (4 bits; those are left out) and how many follow of each point (5 bits). Then the
// points, in rising v: of v what was added since the one before, its high part in as many ones as it counts and a zero
// (after 24 ones: 16 bits instead, the whole of it), then as many low bits as the head says (Rice); of the others their
// bits. What is left of the last byte is zero.

#include <mapweave/maps/keyframe.h>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace mapweave {

// Whether v rises, and there are enough points to be worth it.
bool can_be_dense(const std::vector<KeyframePoint>&);
std::string dense(const std::vector<KeyframePoint>&);  // of those that can be
// Of `count` points; nullopt where these are no such bytes. Takes no more memory than the points.
std::optional<std::vector<KeyframePoint>> from_dense(std::string_view bytes, std::size_t count);

}  // namespace mapweave
