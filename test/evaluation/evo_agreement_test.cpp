// The numbers of evo, stored by scripts/evaluation/make_evo_fixtures.py.
#include <gtest/gtest.h>
#include <mapweave/core/files.h>
#include <mapweave/evaluation/absolute_error.h>
#include <mapweave/evaluation/tum_trajectory.h>
#include <support/data.h>
#include <nlohmann/json.hpp>

namespace mapweave::evaluation {
namespace {

constexpr double kTolerance = 1e-6;

AlignmentKind alignment_named(const std::string& name) {
  return name == "none" ? AlignmentKind::none : name == "se3" ? AlignmentKind::se3 : AlignmentKind::sim3;
}

void expect_same(const Statistics& ours, const nlohmann::json& evo) {
  EXPECT_NEAR(ours.rmse, evo.at("rmse").get<double>(), kTolerance);
  EXPECT_NEAR(ours.mean, evo.at("mean").get<double>(), kTolerance);
  EXPECT_NEAR(ours.median, evo.at("median").get<double>(), kTolerance);
  EXPECT_NEAR(ours.std, evo.at("std").get<double>(), kTolerance);
  EXPECT_NEAR(ours.min, evo.at("min").get<double>(), kTolerance);
  EXPECT_NEAR(ours.max, evo.at("max").get<double>(), kTolerance);
  EXPECT_NEAR(ours.sse, evo.at("sse").get<double>(), kTolerance * (1.0 + evo.at("sse").get<double>()));
}

class EvoAgreement : public testing::TestWithParam<const char*> {};

TEST_P(EvoAgreement, every_statistic_is_evos) {
  const std::string name = GetParam();
  const auto known = nlohmann::json::parse(read_file(test::own_data("evo/results.json"))).at("cases").at(name);
  const Trajectory reference = read_tum(test::own_data("evo/" + name + "_reference.tum"));
  const Trajectory estimate = read_tum(test::own_data("evo/" + name + "_estimate.tum"));
  ASSERT_EQ(known.at("results").size(), 18u);
  for (const auto& result : known.at("results")) {
    SCOPED_TRACE(result.dump().substr(0, 120));
    const TrajectoryErrorOptions options{alignment_named(result.at("align")), known.at("max_stamp_difference_s")};
    TrajectoryError error;
    if (result.at("kind") == "absolute") {
      error = absolute_error(estimate, reference, options);
      EXPECT_EQ(error.pairs, known.at("pairs").get<std::size_t>());
    } else {
      const auto unit = result.at("unit") == "frames" ? DeltaUnit::frames : DeltaUnit::metres;
      error = relative_error(estimate, reference, options, {result.at("delta"), unit, result.at("all_pairs"), 0.1});
    }
    expect_same(error.translation_m, result.at("translation_m"));
    expect_same(error.rotation_deg, result.at("rotation_deg"));
    if (!result.contains("reference_from_estimate")) continue;
    const Eigen::Matrix3d turn =
        error.reference_from_estimate.scale * error.reference_from_estimate.pose.q.toRotationMatrix();
    for (int row = 0; row < 3; ++row) {
      for (int column = 0; column < 3; ++column)
        EXPECT_NEAR(turn(row, column),
                    result.at("reference_from_estimate")
                        .at(static_cast<std::size_t>(row))
                        .at(static_cast<std::size_t>(column))
                        .get<double>(),
                    kTolerance);
      EXPECT_NEAR(error.reference_from_estimate.pose.t(row),
                  result.at("reference_from_estimate").at(static_cast<std::size_t>(row)).at(3).get<double>(),
                  kTolerance);
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Cases, EvoAgreement, testing::Values("planar", "handheld"),
                         [](const auto& tested) { return std::string(tested.param); });

}  // namespace
}  // namespace mapweave::evaluation
