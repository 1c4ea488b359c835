#pragma once
// How a program ends, whatever happens.

#include <mapweave/core/exit_code.h>

#include <functional>

namespace mapweave::app {

// Runs the program, says on stderr what went wrong, and returns the number of its exit code. Before it limits the
// memory that is kept (limit_kept_memory()).
int exit_code_of(const char* program, const std::function<ExitCode()>& run);

}  // namespace mapweave::app
