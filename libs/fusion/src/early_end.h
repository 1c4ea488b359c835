#pragma once
// What fuse() does when an interruption comes (FusionInput::early_end).

#include <mapweave/core/interrupt.h>
#include <mapweave/fusion/fuse.h>

namespace mapweave::fusion {

// True where an interruption has ended the search for places that coincide: nothing more is judged. Takes the
// interruption; throws Interrupted where the input does not want the search to end early. Thread-safe.
inline bool is_over(const FusionInput& input) {
  if (input.early_end && *input.early_end) return true;
  if (!interrupted()) return false;
  if (!input.early_end) throw Interrupted();
  *input.early_end = true;
  clear_interrupt();
  return true;
}

}  // namespace mapweave::fusion
