#pragma once
// Text with numbers in it, as printf writes them.

#include <string>

namespace mapweave {

[[gnu::format(printf, 1, 2)]] std::string format(const char* pattern, ...);

}  // namespace mapweave
