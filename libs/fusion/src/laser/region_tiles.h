#pragma once
// What two maps saw of each other's walls, by small squares: regions may lie anywhere, not only where their borders
// are.

#include "wall_agreement.h"

#include <map>
#include <utility>

namespace mapweave::fusion {

class RegionTiles {
 public:
  using Around = RegionAgreement::Around;
  Around& at(double x_m, double y_m);  // team frame
  // The region about the middle of what is in doubt in this one; about its own middle where nothing is.
  Around around_doubt_of(const RegionAgreement& region) const;

 private:
  std::map<std::pair<int, int>, Around> tiles_;  // by rows and columns
};

}  // namespace mapweave::fusion
