#include <mapweave/maps/alignment.h>

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
    case Reason::excluded: return "excluded";
    case Reason::same_recording: return "same_recording";
    case Reason::little_evidence: return "little_evidence";
    case Reason::other_widths: return "other_widths";
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

Eigen::Matrix3d adjoint(const Pose2& a_from_b) {
  const double c = std::cos(a_from_b.phi), s = std::sin(a_from_b.phi);
  Eigen::Matrix3d result;
  result << c, -s, a_from_b.y, s, c, -a_from_b.x, 0, 0, 1;
  return result;
}

Alignment inverse(const Alignment& a_from_b) {
  Alignment result;
  result.a_from_b.pose = inverse(a_from_b.a_from_b.pose);
  const Eigen::Matrix3d carry = adjoint(planar(a_from_b.a_from_b.pose));
  result.covariance = spatial(Eigen::Matrix3d(carry * planar(a_from_b.covariance) * carry.transpose()));
  return result;
}

}  // namespace mapweave
