#include <mapweave/maps/reasons.h>

namespace mapweave {

std::string_view in_words(Reason reason) {
  switch (reason) {
    case Reason::none: return "no doubt";
    case Reason::little_overlap: return "they show too little common ground";
    case Reason::contradiction: return "one saw through walls of the other";
    case Reason::ambiguous: return "they fit together in more than one way";
    case Reason::unobservable: return "they could slide along each other";
    case Reason::inconsistent: return "it disagrees with other alignments";
    case Reason::vetoed: return "a judgement of them was vetoed";
    case Reason::too_few_witnesses: return "too few places agree on how they fit";
    case Reason::excluded: return "the user excluded this pair";
    case Reason::same_recording: return "they hold the same recording, which counts once";
    case Reason::little_evidence: return "what fits may fit by chance";
    case Reason::other_widths: return "rooms are wider in one map than in the other";
  }
  return "no reason given";
}

std::string_view to_text(Sense sense) {
  switch (sense) {
    case Sense::lasers: return "lasers";
    case Sense::grids: return "grids";
    case Sense::cameras: return "cameras";
  }
  return "unknown";
}

std::string_view what_helps(Reason reason) {
  switch (reason) {
    case Reason::none: break;
    case Reason::little_overlap: return "drive where the other robot was, or give a prior (--anchor)";
    case Reason::contradiction:
      return "most likely they are different places; if not, drive there again: something moved, or a map is bent";
    case Reason::ambiguous: return "drive where it looks different, add a third robot, or give a prior (--anchor)";
    case Reason::unobservable: return "drive around a corner, or give a prior (--anchor)";
    case Reason::inconsistent:
      return "look at the other alignments (mapweave explain); leave out a robot whose map is wrong (--without)";
    case Reason::vetoed: return "merge without --veto";
    case Reason::too_few_witnesses: return "drive more of what the other robot saw, or give a prior (--anchor)";
    case Reason::excluded: return "merge without --refuse";
    case Reason::same_recording: return "leave one of them out (--without)";
    case Reason::little_evidence: return "drive more of what the other robot saw, or give a prior (--anchor)";
    case Reason::other_widths:
      return "most likely they are different buildings that are made alike; if not, one laser's ranges are off";
  }
  return {};
}

}  // namespace mapweave
