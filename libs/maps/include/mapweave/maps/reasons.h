#pragma once
// Why maps stay apart, in words: the same on the console, in merges.json and in the guide's table
// (apps/mapweave/guide/merges.md).

#include <mapweave/maps/judgement.h>

#include <string_view>

namespace mapweave {

// Of a pair of maps, to stand after "kept apart: ".
std::string_view in_words(Reason);
std::string_view to_text(Sense);  // "lasers", "grids", "cameras"
// What somebody can do about it; may be empty.
std::string_view what_helps(Reason);
constexpr Reason kLastReason = Reason::other_widths;

}  // namespace mapweave
