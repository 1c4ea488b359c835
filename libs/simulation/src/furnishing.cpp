#include "furnishing.h"

#include "plan_parts.h"

#include <algorithm>

namespace mapweave::simulation {

FloorPlan furnished(FloorPlan plan, const FurnitureOptions& options, std::uint64_t seed) {
  const auto old_pieces = std::move(plan.pieces);
  plan.pieces.clear();
  plan.walls.erase(
      std::remove_if(plan.walls.begin(), plan.walls.end(), [](const Wall& wall) { return wall.piece >= 0; }),
      plan.walls.end());
  const RandomStream shapes(seed, "round furniture"), changes(seed, "changed furniture");
  const std::uint64_t sessions = 1000;
  for (std::size_t i = 0; i < old_pieces.size(); ++i) {
    Piece piece = old_pieces[i];
    if (piece.twin < 0)
      piece.twin = static_cast<int>(i) + 1024;  // its own, whatever becomes of the others; copied rooms have lower ones
    const std::uint64_t key = static_cast<std::uint64_t>(piece.twin);
    if (piece.shape == PieceShape::box && shapes.at(key).chance(options.round)) piece.shape = PieceShape::cylinder;
    RandomNumbers numbers = changes.at(i * sessions + static_cast<std::uint64_t>(options.session));
    if (options.session > 0 && numbers.chance(options.changed)) {
      if (numbers.chance(0.4)) continue;
      // Within what the old one covered, so that it stands in nobody's way.
      const double width = piece.footprint.width() * numbers.uniform(0.5, 0.9),
                   height = piece.footprint.height() * numbers.uniform(0.5, 0.9);
      const double x = piece.footprint.low_x + numbers.uniform() * (piece.footprint.width() - width);
      const double y = piece.footprint.low_y + numbers.uniform() * (piece.footprint.height() - height);
      piece.footprint = {x, y, x + width, y + height};
      piece.twin = (1 << 18) + static_cast<int>(i * sessions) + options.session;
    }
    add_piece(plan, piece);
  }
  return plan;
}

}  // namespace mapweave::simulation
