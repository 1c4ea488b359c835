#include <mapweave/maps/judgement.h>

namespace mapweave {

std::string_view to_text(Reason reason) {
  switch (reason) {
    case Reason::none: return "none";
    case Reason::little_overlap: return "little_overlap";
    case Reason::contradiction: return "contradiction";
    case Reason::ambiguous: return "ambiguous";
    case Reason::unobservable: return "unobservable";
    case Reason::inconsistent: return "inconsistent";
    case Reason::vetoed: return "vetoed";
    case Reason::too_few_witnesses: return "too_few_witnesses";
  }
  return "unknown";
}

std::string_view to_text(Decision decision) {
  switch (decision) {
    case Decision::accepted: return "accepted";
    case Decision::refused: return "refused";
    case Decision::deferred: return "deferred";
  }
  return "unknown";
}

}  // namespace mapweave
