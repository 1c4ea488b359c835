#pragma once
// What two maps saw of each other's walls, by small squares: regions may lie anywhere, not only where their borders
// are.

#include "wall_agreement.h"

#include <map>
#include <utility>

namespace mapweave::fusion {

class RegionTiles {
 public:
  using Square = RegionAgreement::Square;
  Square& at(double x_m, double y_m);  // team frame
  // As large as the region, about the middle of what is in doubt in it; about its own middle where nothing is.
  Square around_doubt_of(const RegionAgreement& region) const;
  // The square of kSmallSide_m within the region in which most is in doubt, empty where nothing is; of equal ones the
  // first by rows.
  Square most_doubted_of(const RegionAgreement& region) const;

 private:
  Square sum_about(double x_m, double y_m, double side_m) const;

  std::map<std::pair<int, int>, Square> tiles_;  // by rows and columns
};

}  // namespace mapweave::fusion
