#pragma once
#include <mapweave/core/progress.h>

#include <functional>

namespace mapweave {

// Where progress goes and what time it is; given by tests.
struct ProgressOutput {
  bool live = false;                                 // one line rewritten in place, or plain lines
  std::function<void(std::string_view)> write_line;  // stays
  std::function<void(std::string_view)> show_live;   // replaced by the next; only where live
  std::function<double()> seconds;                   // of a clock that never goes back
};
std::unique_ptr<Progress> make_progress(ProgressOutput output);

}  // namespace mapweave
