#pragma once
// What programs end with (README, verbs). Scripts rely on the numbers.

#include <mapweave/core/error.h>

namespace mapweave {

enum class ExitCode : int {
  done = 0,
  failed = 1,         // internal, or results cannot be written
  wrong_usage = 2,    // of the command line
  bad_input = 3,      // or missing
  stayed_apart = 4,   // done, but some maps stayed apart
  gate_failed = 5,    // a number is larger than was asked for
  unanswered = 6,     // a broker did not answer; it may later
  interrupted = 130,  // what was finished is saved
};

// For an error that ends the program.
ExitCode exit_code(ErrorCode code);

}  // namespace mapweave
