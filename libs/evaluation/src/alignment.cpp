#include <mapweave/evaluation/alignment.h>

#include <mapweave/core/error.h>

#include <Eigen/Eigenvalues>
#include <Eigen/SVD>

#include <limits>

namespace mapweave::evaluation {
namespace {

Error undetermined(const std::string& what, const std::string& remedy) {
  return Error(ErrorCode::kBadInput, "the alignment is not determined: " + what, {}, remedy);
}

}  // namespace

std::vector<PosePair> associated(const Trajectory& estimate, const Trajectory& reference, double max_difference_s) {
  const bool estimate_is_shorter = estimate.size() <= reference.size();
  const Trajectory& shorter = estimate_is_shorter ? estimate : reference;
  const Trajectory& longer = estimate_is_shorter ? reference : estimate;
  std::vector<PosePair> pairs;
  for (const auto& point : shorter) {
    const auto* other = nearest_point(longer, point.stamp, max_difference_s);
    if (other == nullptr) continue;
    if (estimate_is_shorter)
      pairs.push_back({point.stamp, other->pose, point.pose});
    else
      pairs.push_back({other->stamp, point.pose, other->pose});
  }
  return pairs;
}

Sim3 reference_from_estimate(const std::vector<PosePair>& pairs, AlignmentKind kind) {
  Sim3 result;
  if (kind == AlignmentKind::none) return result;
  MAPWEAVE_EXPECT(!pairs.empty(), "alignment needs pairs of poses");
  const double count = static_cast<double>(pairs.size());
  Eigen::Vector3d reference_mean = Eigen::Vector3d::Zero(), estimate_mean = Eigen::Vector3d::Zero();
  for (const auto& pair : pairs) {
    reference_mean += pair.reference.t / count;
    estimate_mean += pair.estimate.t / count;
  }
  Eigen::Matrix3d covariance = Eigen::Matrix3d::Zero();  // of reference and estimate: Umeyama, eq. 38
  double estimate_variance = 0.0;                        // eq. 36
  for (const auto& pair : pairs) {
    const Eigen::Vector3d difference = pair.estimate.t - estimate_mean;
    covariance += (pair.reference.t - reference_mean) * difference.transpose() / count;
    estimate_variance += difference.squaredNorm() / count;
  }
  const double smallest = std::numeric_limits<double>::epsilon();

  if (kind == AlignmentKind::se2) {
    const double sine = covariance(1, 0) - covariance(0, 1), cosine = covariance(0, 0) + covariance(1, 1);
    if (!(std::hypot(sine, cosine) > smallest))
      throw undetermined("in the x-y plane no direction stands out (a robot that stood still?)", "use --align none");
    result.pose.q = Eigen::Quaterniond(Eigen::AngleAxisd(std::atan2(sine, cosine), Eigen::Vector3d::UnitZ()));
    result.pose.t = reference_mean - result.pose.q * estimate_mean;
    result.pose.t.z() = 0.0;
    return result;
  }

  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(covariance, Eigen::ComputeFullU | Eigen::ComputeFullV);
  if (!(svd.singularValues()(1) > smallest))
    throw undetermined("the positions lie on one line, or in one place", "use --align se2 for robots on a floor");
  Eigen::Vector3d signs(1.0, 1.0, 1.0);
  if (svd.matrixU().determinant() * svd.matrixV().determinant() < 0.0) signs.z() = -1.0;
  const Eigen::Matrix3d rotation = svd.matrixU() * signs.asDiagonal() * svd.matrixV().transpose();
  if (kind == AlignmentKind::sim3) result.scale = svd.singularValues().dot(signs) / estimate_variance;
  result.pose.q = Eigen::Quaterniond(rotation).normalized();
  result.pose.t = reference_mean - result.scale * (result.pose.q * estimate_mean);
  return result;
}

namespace {

// Whether the turns that both bodies make agree better without the rotation between them than with it. Then it is the
// alignment of a short path that is turned, not the body.
bool turns_contradict(const std::vector<PosePair>& aligned, const Eigen::Quaterniond& reference_from_estimate) {
  constexpr std::size_t kPieces = 4;  // of the path: turns over a quarter of it are far larger than noise
  constexpr double kWorse = 1.25, kNoise_rad = 0.002;  // a quarter worse, beyond what poses are off: no chance
  const std::size_t length = std::max<std::size_t>(1, aligned.size() / kPieces);
  double with = 0.0, without = 0.0, count = 0.0;
  for (std::size_t i = 0; i + length < aligned.size(); ++i, count += 1.0) {
    const PosePair &from = aligned[i], &to = aligned[i + length];
    const Eigen::Quaterniond reference = from.reference.q.conjugate() * to.reference.q,
                             estimate = from.estimate.q.conjugate() * to.estimate.q;
    without += std::pow(reference.angularDistance(estimate), 2);
    with += std::pow(
        reference.angularDistance(reference_from_estimate * estimate * reference_from_estimate.conjugate()), 2);
  }
  return count > 0.0 && std::sqrt(with / count) > kWorse * std::sqrt(without / count) + kNoise_rad;
}

}  // namespace

std::optional<ConstantRotation> constant_rotation(const std::vector<PosePair>& aligned) {
  // Smaller rotations are errors of the estimate; those within three times its spread may be (DECISIONS.md, 81).
  constexpr double kLeast_deg = 3.0, kLeastOfSpread = 3.0, kDegrees = 180.0 / M_PI;
  if (aligned.empty()) return std::nullopt;
  // The mean of rotations: Markley et al., "Averaging quaternions", 2007.
  Eigen::Matrix4d sum = Eigen::Matrix4d::Zero();
  for (const auto& pair : aligned) {
    const Eigen::Vector4d q = (pair.reference.q.conjugate() * pair.estimate.q).coeffs();
    sum += q * q.transpose();
  }
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix4d> solver(sum);
  ConstantRotation result;
  result.reference_body_from_estimate_body.coeffs() = solver.eigenvectors().col(3);
  result.reference_body_from_estimate_body.normalize();
  result.angle_deg =
      result.reference_body_from_estimate_body.angularDistance(Eigen::Quaterniond::Identity()) * kDegrees;
  for (const auto& pair : aligned) {
    const double off_deg =
        kDegrees * (pair.reference.q * result.reference_body_from_estimate_body).angularDistance(pair.estimate.q);
    result.spread_deg += off_deg * off_deg / static_cast<double>(aligned.size());
  }
  result.spread_deg = std::sqrt(result.spread_deg);
  const bool is_one = result.angle_deg >= kLeast_deg && result.angle_deg >= kLeastOfSpread * result.spread_deg;
  return is_one && !turns_contradict(aligned, result.reference_body_from_estimate_body) ? std::optional(result)
                                                                                        : std::nullopt;
}

Pose3 robot_from_optical() { return {Eigen::Vector3d::Zero(), Eigen::Quaterniond(0.5, -0.5, 0.5, -0.5)}; }

}  // namespace mapweave::evaluation
