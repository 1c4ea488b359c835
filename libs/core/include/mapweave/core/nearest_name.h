#pragma once
// "Did you mean ...?": what a misspelt name was probably meant to be.

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace mapweave {

// Letters inserted, removed, replaced, or two neighbours swapped, to make one text of the other.
std::size_t edit_distance(std::string_view a, std::string_view b);

// The candidate with the fewest edits, the first of equals; nullopt where even that needs more than a third of its
// letters.
std::optional<std::string> nearest_name(std::string_view name, const std::vector<std::string>& candidates);

}  // namespace mapweave
