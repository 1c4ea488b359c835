#include <gmock/gmock.h>
#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/scheduling/latency_model.h>
#include <mapweave/scheduling/profile.h>

#include <support/temporary_folder.h>

#include <cmath>
#include <random>

namespace mapweave::scheduling {
namespace {

using testing::HasSubstr;

Problem two_edges() {
  return parse_problem(
      R"({"robots": ["a", "b", "c"], "overlaps": [["a", "b", 0.25], ["b", "c", 0.5]], "robot_scans": {"a": 100, "b": 100, "c": 100},
    "edges": [{"id": "e", "bandwidth_bytes_per_s": 1000}, {"id": "f", "bandwidth_bytes_per_s": 500, "speed": 2}], "links": [["a", "f", 100, 3]]})",
      "p.json");
}

LatencyModel round_numbers() {
  LatencyModel model;
  model.pack_s_per_scan = 0.01;
  model.scan_bytes = 10;
  model.robot_bytes_per_s = 1000;
  model.robot_delay_s = 0.5;
  model.slam_s_per_scan = 0.02;
  model.edge_fusion = {0.25, 0.5, 2.0};
  model.map_bytes_per_scan = 20;
  model.map_bytes_fixed = 0;
  model.cloud_delay_s = 0.125;
  model.cloud_fusion = {0, 1, 4};
  return model;
}

TEST(LatencyModel, adds_up_by_hand) {
  const Problem problem = two_edges();
  const LatencyModel model = round_numbers();
  const Latency latency(problem, model);
  EXPECT_DOUBLE_EQ(latency.robot_seconds(0, 0), 1.0 + 1.0 + 0.5 + 2.0);   // eq. 1: pack, wire, delay, SLAM
  EXPECT_DOUBLE_EQ(latency.robot_seconds(0, 1), 1.0 + 10.0 + 3.0 + 1.0);  // the link of its own, twice the speed
  EXPECT_DOUBLE_EQ(latency.computing_seconds({0, 1}, 0), 4.5 + 0.25 + 1.0 + 2.0);
  EXPECT_DOUBLE_EQ(latency.fused_bytes({0, 1}), 3000.0);  // 2000 + 2000 - 0.25 * 4000
  EXPECT_DOUBLE_EQ(latency.fused_bytes({1, 2}), 2000.0);  // degree 0.5: the same map
  EXPECT_DOUBLE_EQ(latency.fused_bytes({0, 2}), 4000.0);
  EXPECT_DOUBLE_EQ(latency.edge_seconds({0, 1}, 0), 7.75 + 3.0 + 0.125);
  // Robot c alone on f: 1 + 1 + 0.5 + 1, fused in half the time, 2000 bytes at 500 a second.
  EXPECT_DOUBLE_EQ(latency.edge_seconds({2}, 1), 3.5 + 0.375 + 4.0 + 0.125);
  EXPECT_DOUBLE_EQ(latency.total_seconds({{0, 1}, {2}}), 10.875 + 2.0 + 4.0);
  EXPECT_DOUBLE_EQ(latency.total_seconds({{0, 1, 2}, {}}),
                   latency.edge_seconds({0, 1, 2}, 0) + 1.0);  // an edge without robots sends nothing
}

TEST(LatencyModel, never_has_a_fused_map_below_its_largest_part_or_above_the_sum) {
  std::mt19937_64 random(3);
  for (int i = 0; i < 50; ++i) {
    Problem problem = two_edges();
    const auto weight = [&] { return 0.7 * static_cast<double>(random() >> 11) * 0x1p-53; };  // some above 0.5, which no overlap is
    problem.overlaps = OverlapGraph(3, {{0, 1, weight()}, {1, 2, weight()}, {0, 2, weight()}});
    for (auto& scans : problem.scans) scans = static_cast<double>(random() % 1000);
    const LatencyModel model = round_numbers();
    const Latency latency(problem, model);
    const double fused = latency.fused_bytes({0, 1, 2}), a = latency.map_bytes(0), b = latency.map_bytes(1), c = latency.map_bytes(2);
    EXPECT_GE(fused, std::max({a, b, c}));
    EXPECT_LE(fused, a + b + c + 1e-9);
    EXPECT_GE(fused + 1e-9, latency.own_bytes(0) + latency.own_bytes(1) + latency.own_bytes(2));
  }
}

TEST(LatencyModel, comes_back_from_its_file_to_the_last_bit) {
  const LatencyModel model = round_numbers();
  EXPECT_EQ(model_json(parse_model(model_json(model), "m.json")), model_json(model));
  EXPECT_EQ(parse_model("{}", "m.json").slam_s_per_scan, LatencyModel().slam_s_per_scan);
}

TEST(LatencyModel, refuses_what_cannot_be) {
  const auto refusal = [](const char* json) -> std::string {
    try {
      parse_model(json, "m.json");
    } catch (const Error& error) {
      return error.what();
    }
    return "accepted";
  };
  EXPECT_THAT(refusal(R"({"slam_s_per_scan": -1})"), AllOf(HasSubstr("m.json"), HasSubstr("slam_s_per_scan")));
  EXPECT_THAT(refusal(R"({"slam_per_scan": 1})"), HasSubstr("did you mean 'slam_s_per_scan'?"));
  EXPECT_THAT(refusal(R"({"edge_fusion": {"per_pairs_s": 1}})"), HasSubstr("did you mean 'per_pair_s'?"));
  EXPECT_THAT(refusal(R"({"robot_bytes_per_s": 0})"), HasSubstr("robot_bytes_per_s"));
  EXPECT_THAT(refusal("{"), HasSubstr("not JSON"));
}

TEST(Regression, finds_a_quadratic_and_how_far_to_trust_it) {
  std::mt19937_64 random(5);
  const auto noise = [&] {
    double sum = -6.0;
    for (int i = 0; i < 12; ++i) sum += static_cast<double>(random() >> 11) * 0x1p-53;
    return 0.1 * sum;
  };
  const auto basis = [](double maps) { return std::vector<double>{1.0, maps, 0.5 * maps * (maps - 1.0)}; };
  constexpr int kSamples = 44;
  Eigen::MatrixXd rows(kSamples, 3);
  Eigen::VectorXd seconds(kSamples);
  for (int i = 0; i < kSamples; ++i) {
    const double maps = 2 + i % 11;
    for (int k = 0; k < 3; ++k) rows(i, k) = basis(maps)[static_cast<std::size_t>(k)];
    seconds[i] = 1.0 + 0.2 * maps + 0.5 * 0.5 * maps * (maps - 1.0) + noise();
  }
  const Regression found = fit(rows, seconds);
  EXPECT_NEAR(found.coefficients[2], 0.5, 0.02);
  EXPECT_NEAR(found.standard_error, 0.1, 0.03);
  EXPECT_GT(found.r_squared, 0.99);
  EXPECT_EQ(found.degrees_of_freedom, 41u);
  EXPECT_NEAR(found.residuals[3], seconds[3] - found.at(basis(5)), 1e-12);
  // 95 % of new samples lie within the interval.
  int within = 0;
  for (int i = 0; i < 2000; ++i) {
    const double maps = 2 + i % 11, sample = 1.0 + 0.2 * maps + 0.25 * maps * (maps - 1.0) + noise();
    within += std::abs(sample - found.at(basis(maps))) < found.interval(basis(maps));
  }
  EXPECT_NEAR(within / 2000.0, 0.95, 0.035);
}

TEST(Regression, holds_at_nothing_what_would_be_negative) {
  Eigen::MatrixXd rows(4, 2);
  rows << 1, 1, 1, 2, 1, 3, 1, 4;
  const Regression found = fit(rows, Eigen::Vector4d(0.5, 2.0, 3.5, 5.0));  // -1 + 1.5 x
  EXPECT_EQ(found.coefficients[0], 0.0);
  EXPECT_NEAR(found.coefficients[1], 35.0 / 30.0, 1e-12);
  const Regression one = fit(Eigen::MatrixXd::Ones(1, 1), Eigen::VectorXd::Constant(1, 3.0));
  EXPECT_EQ(one.coefficients[0], 3.0);
  EXPECT_TRUE(std::isinf(one.interval({1.0})));
}

TEST(Regression, knows_students_quantiles) {
  EXPECT_NEAR(student_quantile(0.975, 1), 12.7062, 1e-3);
  EXPECT_NEAR(student_quantile(0.975, 2), 4.30265, 1e-4);
  EXPECT_NEAR(student_quantile(0.975, 5), 2.57058, 1e-4);
  EXPECT_NEAR(student_quantile(0.95, 10), 1.81246, 1e-4);
  EXPECT_NEAR(student_quantile(0.975, 1000), 1.96234, 1e-4);
}

TEST(Profile, learns_from_summaries) {
  const test::TemporaryFolder folder;
  const auto summary = [&](const char* name, double scale) {
    const auto path = folder.path() / name;
    std::filesystem::create_directories(path);
    const auto of = [](double number) { return std::to_string(number); };
    write_file(path / "summary.json", R"({"robots": [{"id": "a", "scans": 100, "cpu_seconds": )" + of(0.2 * scale) +
                                          R"(, "mapped": true, "edge": "n"},
                 {"id": "b", "scans": 300, "cpu_seconds": )" +
                                          of(0.6 * scale) + R"(, "mapped": true, "edge": "n"},
                 {"id": "c", "scans": 200, "cpu_seconds": )" +
                                          of(0.4 * scale) + R"(, "mapped": true, "edge": "s"},
                 {"id": "d", "scans": 0, "cpu_seconds": 9, "mapped": false, "edge": "s"}],
                "stages": [{"tier": "n", "name": "features", "seconds": 1}, {"tier": "n", "name": "pairwise matching", "seconds": 2},
                 {"tier": "n", "name": "mapping a", "seconds": 50}, {"tier": "s", "name": "features", "seconds": 0.5},
                 {"tier": "cloud", "name": "features", "seconds": 4}, {"tier": "", "name": "output", "seconds": 7}]})");
    return path;
  };
  const Profile profile = profile_runs({summary("one", 0.9), summary("two", 1.1)});
  EXPECT_NEAR(profile.model.slam_s_per_scan, 0.002, 1e-9);
  EXPECT_EQ(profile.model.scans, 200.0);
  EXPECT_NEAR(profile.model.edge_fusion.seconds(1), 0.5, 1e-9);
  EXPECT_NEAR(profile.model.edge_fusion.seconds(2), 3.0, 1e-9);
  EXPECT_NEAR(profile.model.cloud_fusion.seconds(2), 4.0, 1e-9);
  EXPECT_EQ(profile.model.map_bytes_per_scan, LatencyModel().map_bytes_per_scan);
  EXPECT_EQ(profile.notes.size(), 1u);  // the folders hold no maps
}

TEST(Profile, names_the_summary_that_cannot_be_one) {
  const test::TemporaryFolder folder;
  EXPECT_THROW(profile_runs({folder.path() / "none"}), Error);
  for (const char* text : {"", "[]", "{}", R"({"robots": 3, "stages": []})", R"({"robots": [3], "stages": []})",
                           R"({"robots": [{"id": "../x", "scans": 1, "cpu_seconds": 1, "mapped": true}], "stages": []})",
                           R"({"robots": [], "stages": [{"tier": 1, "name": "features", "seconds": 1}]})",
                           R"({"robots": [], "stages": [{"tier": "a", "name": "features", "seconds": -1}]})"}) {
    write_file(folder.path() / "summary.json", text);
    try {
      profile_runs({folder.path()});
      ADD_FAILURE() << text;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr("summary.json"));
    }
  }
}

}  // namespace
}  // namespace mapweave::scheduling
