#pragma once
// Motion from scan to scan, by aligning each scan with the few key scans before it.

#include "observations.h"

#include <deque>
#include <optional>

namespace mapweave::mrpt_mapper {

class LocalMatcher {
 public:
  // With `search_turns`, a scan that does not fit at the guess is tried turned as well: for guesses that no wheels
  // gave.
  explicit LocalMatcher(bool search_turns) : search_turns_(search_turns) {}

  // Where the scan is, seen from the last one that was placed; nullopt: it fits nowhere near the guess. Either way it
  // is placed, at the answer or at the guess.
  std::optional<Pose2> place(const mrpt::obs::CObservation2DRangeScan&, const Pose2& last_from_this_guess);
  void forget();  // the next scan is a first one

 private:
  struct KeyScan {
    Pose2 local_from_robot;
    mrpt::maps::CSimplePointsMap points;  // robot frame
  };
  void remember(const Pose2& local_from_robot, mrpt::maps::CSimplePointsMap points);

  bool search_turns_;
  std::deque<KeyScan> key_scans_;
  mrpt::maps::CSimplePointsMap reference_;  // all of them
  Pose2 local_from_last_;
};

}  // namespace mapweave::mrpt_mapper
