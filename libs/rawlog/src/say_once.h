#pragma once

#include <string>

namespace mapweave::rawlog {

// A warning that is logged once in a process: recordings are opened several times. For any thread.
void say_once(const std::string& text);

}  // namespace mapweave::rawlog
