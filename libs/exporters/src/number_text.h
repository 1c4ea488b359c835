#pragma once
// Numbers as text, the same in every locale.

#include <string>

namespace mapweave::exporters {

void append_fixed(std::string& text, double value, int decimals);  // -0.000 is written 0.000
void append_shortest(std::string& text, double value);  // the fewest digits that read back as the same number

}  // namespace mapweave::exporters
