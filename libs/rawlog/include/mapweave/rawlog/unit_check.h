#pragma once
// Whether the numbers of a recording can be metres and radians, judged by its first scans, frames and steps.

#include <mapweave/rawlog/observation_stream.h>

#include <memory>
#include <string>
#include <vector>

namespace mapweave::rawlog {

struct UnitDoubt {
  std::string what;              // "half of the readings of laser 'FLASER' are farther than 4200 m; ..."
  std::string guess;             // "are they in millimetres?"
  bool nothing_is_left = false;  // of such numbers nothing can be mapped
};

// Of one recording, a call for each record in order. Records after its beginning are passed over. Not thread-safe.
class UnitCheck {
 public:
  UnitCheck();
  ~UnitCheck();
  UnitCheck(UnitCheck&&) noexcept;
  std::vector<UnitDoubt> add(const Record& record);  // what is new
  std::vector<UnitDoubt> finish();                   // what is new where the recording ends here

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace mapweave::rawlog
