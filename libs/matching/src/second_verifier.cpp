#include "point_registration.h"

#include <mapweave/matching/judge.h>

namespace mapweave::matching {
namespace {

constexpr std::size_t kMostPoints = 600;   // of the moving side: bounds time
constexpr std::size_t kFewestPoints = 30;  // fewer are aligned by chance

}  // namespace

std::optional<Verification> verify(const SubmapModel& a, const SubmapModel& b, const Pose2& a_from_b) {
  // Only walls of b where a looked: the others can have no partner.
  const std::vector<WallPoint> all = placed(a_from_b, b.walls());
  std::vector<WallPoint> moving;
  for (const WallPoint& p : all)
    if (a.sight().get(cell_of(p.x, 1.0 / SubmapModel::kSightResolution),
                      cell_of(p.y, 1.0 / SubmapModel::kSightResolution)) != Sight::unknown)
      moving.push_back(p);
  if (a.walls().size() < kFewestPoints || moving.size() < kFewestPoints) return std::nullopt;
  if (moving.size() > kMostPoints) {
    std::vector<WallPoint> fewer;
    for (std::size_t i = 0; i < kMostPoints; ++i) fewer.push_back(moving[i * moving.size() / kMostPoints]);
    moving = std::move(fewer);
  }
  const auto registered =
      PointRegistration(a.walls()).refine(moving, {0.5, 0.35, 0.25, 0.15, 0.15, 0.15}, kFewestPoints / 2);
  if (!registered) return std::nullopt;
  const Eigen::Matrix4f& moved = registered->moved;
  Verification result;
  result.inliers = static_cast<double>(registered->paired) / static_cast<double>(moving.size());
  const double c = std::cos(a_from_b.phi), s = std::sin(a_from_b.phi);
  const Eigen::Vector4f centre(static_cast<float>(c * b.centre().x - s * b.centre().y + a_from_b.x),
                               static_cast<float>(s * b.centre().x + c * b.centre().y + a_from_b.y), 0, 1);
  result.disagreement_m = static_cast<double>(((moved * centre) - centre).head<2>().norm());
  result.disagreement_rad = std::abs(std::atan2(static_cast<double>(moved(1, 0)), static_cast<double>(moved(0, 0))));
  return result;
}

}  // namespace mapweave::matching
