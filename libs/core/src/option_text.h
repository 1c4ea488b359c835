#pragma once
// What an option may be, as text: for messages and for the reference page.

#include <mapweave/core/options.h>

namespace mapweave {

std::string text_of_number(double value);       // shortest that reads back to the same bits
std::string range_text(const Option& option);   // "0..1", "greater than 0", "graph, rbpf or icp"; empty: anything
std::string requirement(const Option& option);  // "it must lie in 0..1"
bool is_in_range(const OptionNumber&, double value);
bool is_in_range(const OptionInteger&, std::int64_t value);

}  // namespace mapweave
