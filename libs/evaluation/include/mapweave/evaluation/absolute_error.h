#pragma once
// Errors of a trajectory against a reference: absolute (ATE: where each pose should have been) and relative (RPE: how
// much each piece of the path drifts). Sturm et al., IROS 2012; the numbers agree with evo's `evo_ape` and `evo_rpe`
// (test/data/evo).

#include <mapweave/evaluation/alignment.h>
#include <mapweave/evaluation/statistics.h>

namespace mapweave::evaluation {

struct TrajectoryErrorOptions {
  AlignmentKind align = AlignmentKind::se2;
  double max_stamp_difference_s = 0.01;  // of poses that belong together
  template <class Visitor>
  void describe(Visitor& v) {
    v.choice("align", align,
             {{"none", AlignmentKind::none},
              {"se2", AlignmentKind::se2},
              {"se3", AlignmentKind::se3},
              {"sim3", AlignmentKind::sim3}},
             "how the estimate is laid on the reference before errors are measured");
    v.non_negative("max_stamp_difference_s", max_stamp_difference_s,
                   "largest difference in seconds between the stamps of an estimated and a reference pose that are "
                   "compared; larger values compare more poses");
  }
};

struct TrajectoryError {
  std::size_t pairs = 0;
  Sim3 reference_from_estimate;  // the alignment
  Statistics translation_m;      // distance of positions
  Statistics rotation_deg;       // angle between orientations, 0..180
};

// One robot's trajectory and its reference.
struct Compared {
  Trajectory estimate, reference;
};

struct AlignedTracks {
  std::vector<std::vector<PosePair>> tracks;  // one for each that was compared; the estimates lie on the references
  Sim3 reference_from_estimate;
};

// One motion for all of them: robots of one map. Throws Error(kBadInput) where the stamps of one of them match nowhere,
// or the alignment is not determined.
AlignedTracks aligned_tracks(const std::vector<Compared>&, const TrajectoryErrorOptions& = {});

// Of all poses of all tracks.
TrajectoryError absolute_error(const AlignedTracks&);

// Throws as aligned_tracks().
TrajectoryError absolute_error(const Trajectory& estimate, const Trajectory& reference,
                               const TrajectoryErrorOptions& = {});

enum class DeltaUnit { frames, metres };

struct RelativeErrorOptions {
  double delta = 1.0;                  // length of the pieces; frames: a whole number
  DeltaUnit unit = DeltaUnit::frames;  // metres: of the path that the estimate went
  bool all_pairs = false;              // pieces from every pose; otherwise one begins where the last ends
  double relative_tolerance = 0.1;     // all pairs, metres: a piece's length may be off by this share of delta
  template <class Visitor>
  void describe(Visitor& v) {
    v.positive("delta", delta,
               "length of the pieces of a trajectory whose drift is measured, in frames or metres, as the option unit "
               "says; larger values measure drift over longer pieces");
    v.choice("unit", unit, {{"frames", DeltaUnit::frames}, {"metres", DeltaUnit::metres}},
             "unit of the option delta: frames, or metres of the estimated path");
    v.flag("all_pairs", all_pairs, "measure a piece from every pose; false: each piece begins where the last one ends");
    v.fraction("relative_tolerance", relative_tolerance,
               "share of delta by which the length of a piece may be off (all_pairs, unit: metres); larger values "
               "measure more pieces");
  }
};

// Errors of the relative poses over each piece; no piece begins in one track and ends in another. The alignment matters
// by its scale alone. Throws Error(kBadInput) as above, and where no piece is that long.
TrajectoryError relative_error(const Trajectory& estimate, const Trajectory& reference,
                               const TrajectoryErrorOptions& = {}, const RelativeErrorOptions& = {});

TrajectoryError relative_error(const AlignedTracks&, const RelativeErrorOptions& = {});

}  // namespace mapweave::evaluation
