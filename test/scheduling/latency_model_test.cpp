#include <gmock/gmock.h>
#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/scheduling/placement.h>
#include <mapweave/scheduling/profile.h>

#include <support/temporary_folder.h>
#include <nlohmann/json.hpp>

#include <cmath>
#include <random>

namespace mapweave::scheduling {
namespace {

using testing::HasSubstr;

Problem two_edges() {
  return parse_problem(
      R"({"robots": ["a", "b", "c"], "overlaps": [["a", "b", 0.25], ["b", "c", 0.5]],
    "robot_scans": {"a": 100, "b": 100, "c": 100},
    "edges": [{"id": "e", "bandwidth_bytes_per_s": 1000}, {"id": "f", "bandwidth_bytes_per_s": 500, "speed": 2}],
    "links": [["a", "f", 100, 3]]})",
      "p.json");
}

LatencyModel round_numbers() {
  LatencyModel model;
  model.pack_s_per_scan = 0.01;
  model.scan_bytes = 10;
  model.robot_bytes_per_s = 1000;
  model.robot_delay_s = 0.5;
  model.slam_s_per_scan = 0.02;
  model.edge_fusion = {0.25, 0.005, 2e-4};
  model.map_bytes_per_scan = 20;
  model.map_bytes_fixed = 0;
  model.edge_bytes_per_map_byte = 1.0;
  model.cloud_delay_s = 0.125;
  model.cloud_fusion = {0, 0.01, 4e-4};
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
  EXPECT_DOUBLE_EQ(latency.edge_seconds({0, 1}, 0), 7.75 + 4.0 + 0.125);  // both maps are sent as they are
  // Robot c alone on f: 1 + 1 + 0.5 + 1, fused in half the time, 2000 bytes at 500 a second.
  EXPECT_DOUBLE_EQ(latency.edge_seconds({2}, 1), 3.5 + 0.375 + 4.0 + 0.125);
  EXPECT_DOUBLE_EQ(latency.total_seconds({{0, 1}, {2}}),
                   11.875 + 3.0 + 4.0);  // 300 scans, 200 x 100 pairs for two edges
  EXPECT_DOUBLE_EQ(latency.total_seconds({{0, 1, 2}, {}}),
                   latency.edge_seconds({0, 1, 2}, 0) + 3.0);  // an edge without robots sends nothing
}

TEST(LatencyModel, counts_pairs_of_scans_between_maps_of_all_sizes) {
  FusedScans fused;
  for (const double scans : {10.0, 0.0, 30.0, 2.0}) fused.add(scans);
  EXPECT_EQ(fused.scans, 42.0);
  EXPECT_EQ(fused.pairs, 10.0 * 30.0 + 10.0 * 2.0 + 30.0 * 2.0);
  EXPECT_DOUBLE_EQ((FusionTime{1.0, 0.5, 0.1}.seconds(fused)), 1.0 + 21.0 + 38.0);
}

TEST(LatencyModel, counts_scans_that_robots_share_where_they_are_fused) {
  const Problem problem = two_edges();  // a and b share 0.25, b and c 0.5, of 100 scans each
  LatencyModel model = round_numbers();
  const Latency without(problem, model);
  const double alone_s = without.computing_seconds({0, 1}, 0), all_s = without.terms({{0, 1}, {2}}).fusion_s;
  model.edge_fusion.per_shared_scan_s = 0.01;
  model.cloud_fusion.per_shared_scan_s = 0.02;
  const Latency latency(problem, model);
  EXPECT_DOUBLE_EQ(latency.shared_scans(), 50.0 + 100.0);
  EXPECT_DOUBLE_EQ(latency.computing_seconds({0, 1}, 0), alone_s + 0.5);
  EXPECT_DOUBLE_EQ(latency.computing_seconds({0, 2}, 0), without.computing_seconds({0, 2}, 0));
  EXPECT_DOUBLE_EQ(latency.terms({{0, 1}, {2}}).fusion_s, all_s + 3.0);  // the cloud matches all of them
}

TEST(LatencyModel, counts_no_more_than_whole_maps_as_shared) {
  Problem problem = two_edges();
  problem.overlaps = OverlapGraph(3, {{0, 1, 3.0}});  // counts of matches, say, which serve for grouping
  LatencyModel model = round_numbers();
  const double without_s = Latency(problem, model).computing_seconds({0, 1}, 0);
  model.edge_fusion.per_shared_scan_s = 0.01;
  const Latency latency(problem, model);
  EXPECT_DOUBLE_EQ(latency.shared_scans(), 0.5 * 200.0);
  EXPECT_DOUBLE_EQ(latency.computing_seconds({0, 1}, 0), without_s + 1.0);
}

TEST(LatencyModel, reports_each_term_of_what_it_predicts) {
  const Problem problem = two_edges();
  const LatencyModel model = round_numbers();
  const LatencyTerms terms = Latency(problem, model).terms({{0, 1}, {2}});
  ASSERT_EQ(terms.edges.size(), 2u);
  ASSERT_EQ(terms.edges[0].robots.size(), 2u);
  const LatencyTerms::RobotTerms& b = terms.edges[0].robots[1];
  EXPECT_EQ(b.robot, 1u);
  EXPECT_DOUBLE_EQ(b.pack_s, 1.0);
  EXPECT_DOUBLE_EQ(b.transfer_s, 1.5);
  EXPECT_DOUBLE_EQ(b.slam_s, 2.0);
  EXPECT_DOUBLE_EQ(terms.edges[0].fusion_s, 3.25);
  EXPECT_DOUBLE_EQ(terms.edges[0].transfer_s, 4.125);
  EXPECT_DOUBLE_EQ(terms.edges[1].fusion_s, 0.375);
  EXPECT_DOUBLE_EQ(terms.fusion_s, 7.0);
  EXPECT_DOUBLE_EQ(terms.total_seconds(), 4.5 + 3.25 + 4.125 + 7.0);
}

TEST(LatencyModel, has_the_slowest_edge_decide_when_pairs_across_edges_are_judged) {
  Problem problem = two_edges();
  LatencyModel model = round_numbers();
  problem.cloud.speed = 10.0;
  const auto fusion_s = [&](const Groups& robots_at) { return Latency(problem, model).terms(robots_at).fusion_s; };
  EXPECT_DOUBLE_EQ(fusion_s({{0, 1}, {2}}), 0.3 + 4e-4 * 2e4 / 2.0);  // edge e, of speed 1, has half of the pairs
  problem.edges[0].speed = 0.25;
  EXPECT_DOUBLE_EQ(fusion_s({{0, 1}, {2}}), 0.3 + 4e-4 * 2e4 / 2.0 / 0.25);
  EXPECT_DOUBLE_EQ(fusion_s({{}, {0, 1, 2}}), 0.3) << "one edge has no pairs across edges, and the other is not used";
  problem.cloud.edges_judge = false;
  EXPECT_DOUBLE_EQ(fusion_s({{0, 1}, {2}}), 0.3 + 4e-4 * 2e4 / 10.0);
}

TEST(LatencyModel, takes_the_delay_of_an_edge_of_which_it_is_said) {
  Problem problem = two_edges();
  const LatencyModel model = round_numbers();
  const double before_s = Latency(problem, model).edge_seconds({2}, 1);
  problem.edges[1].delay_s = 2.125;
  EXPECT_DOUBLE_EQ(Latency(problem, model).edge_seconds({2}, 1), before_s + 2.0);
}

TEST(LatencyModel, counts_what_robots_send_beside_their_scans) {
  const Problem problem = two_edges();
  LatencyModel model = round_numbers();
  const double before_s = Latency(problem, model).robot_seconds(0, 0);
  model.robot_bytes_fixed = 500.0;
  EXPECT_DOUBLE_EQ(Latency(problem, model).robot_seconds(0, 0), before_s + 0.5);
}

TEST(LatencyModel, sends_to_the_cloud_what_edges_send_however_much_maps_share) {
  const Problem problem = two_edges();
  LatencyModel model = round_numbers();
  model.edge_bytes_per_map_byte = 1.25;  // with judgements
  const Latency latency(problem, model);
  EXPECT_DOUBLE_EQ(latency.sent_bytes(0, 0), 2500.0);
  EXPECT_DOUBLE_EQ(latency.terms({{1, 2}, {}}).edges[0].transfer_s, 5.0 + 0.125);  // the same map twice
  EXPECT_DOUBLE_EQ(latency.terms({{0, 2}, {}}).edges[0].transfer_s, 5.0 + 0.125);  // nothing in common
}

TEST(LatencyModel, takes_an_edge_as_its_own_runs_have_shown_it) {
  const Problem problem = two_edges();
  LatencyModel model = round_numbers();
  const Latency before(problem, model);
  model.edges["f"] = {0.04, 0.5, FusionTime{1.0, 0.0, 0.0, 0.0}};
  model.edges["elsewhere"] = {9.0, {}, {}};
  const Latency latency(problem, model);
  EXPECT_EQ(latency.edge_seconds({0, 1}, 0), before.edge_seconds({0, 1}, 0)) << "e is as all are";
  EXPECT_DOUBLE_EQ(latency.robot_seconds(0, 1), before.robot_seconds(0, 1) + 1.0);  // SLAM takes twice as long
  EXPECT_DOUBLE_EQ(latency.edge_seconds({2}, 1), 1.0 + 1.0 + 0.5 + 2.0 + 0.5 + 2.0 + 0.125);
  EXPECT_EQ(model_json(parse_model(model_json(model), "m.json")), model_json(model));
  const LatencyModel partial = parse_model(R"({"edges": {"f": {"fusion": {"fixed_s": 2}}}})", "m.json");
  EXPECT_EQ(partial.edges.at("f").fusion->fixed_s, 2.0);
  EXPECT_EQ(partial.edges.at("f").fusion->per_scan_pair_s, partial.edge_fusion.per_scan_pair_s);
  EXPECT_FALSE(partial.edges.at("f").slam_s_per_scan);
}

TEST(LatencyModel, never_has_a_fused_map_below_its_largest_part_or_above_the_sum) {
  std::mt19937_64 random(3);
  for (int i = 0; i < 50; ++i) {
    Problem problem = two_edges();
    const auto weight = [&] {
      return 0.7 * static_cast<double>(random() >> 11) * 0x1p-53;
    };  // some above 0.5, which no overlap is
    problem.overlaps = OverlapGraph(3, {{0, 1, weight()}, {1, 2, weight()}, {0, 2, weight()}});
    for (auto& scans : problem.scans) scans = static_cast<double>(random() % 1000);
    const LatencyModel model = round_numbers();
    const Latency latency(problem, model);
    const double fused = latency.fused_bytes({0, 1, 2}), a = latency.map_bytes(0), b = latency.map_bytes(1),
                 c = latency.map_bytes(2);
    EXPECT_GE(fused, std::max({a, b, c}));
    EXPECT_LE(fused, a + b + c + 1e-9);
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
  EXPECT_THAT(refusal(R"({"edges": {"f": {"slam": 1}}})"), HasSubstr("edges.f"));
  EXPECT_THAT(refusal(R"({"edges": {"f": {"bytes_per_map_byte": -1}}})"), HasSubstr("edges.f.bytes_per_map_byte"));
  EXPECT_THAT(refusal(R"({"edges": {"../f": {}}})"), HasSubstr("name of an edge"));
  EXPECT_THAT(refusal(R"({"slam_per_scan": 1})"), HasSubstr("did you mean 'slam_s_per_scan'?"));
  EXPECT_THAT(refusal(R"({"edge_fusion": {"per_scan_pairs_s": 1}})"), HasSubstr("did you mean 'per_scan_pair_s'?"));
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

TEST(Regression, fits_short_times_as_well_as_long_ones_where_errors_are_shares) {
  std::mt19937_64 random(9);
  const auto share = [&] { return 1.0 + 0.2 * (static_cast<double>(random() >> 11) * 0x1p-53 - 0.5); };  // within 10 %
  const auto truth = [](double x) { return 0.01 * x + 1e-4 * x * x; };
  constexpr int kSamples = 240;
  Eigen::MatrixXd rows(kSamples, 2);
  Eigen::VectorXd seconds(kSamples);
  for (int i = 0; i < kSamples; ++i) {
    const double x = std::pow(10.0, 0.01 * i);
    rows.row(i) << x, x * x;
    seconds[i] = truth(x) * share();
  }
  const Regression found = fit_relative(rows, seconds);
  EXPECT_NEAR(found.at({1.0, 1.0}), truth(1.0), 0.05 * truth(1.0));
  EXPECT_NEAR(found.at({200.0, 4e4}), truth(200.0), 0.05 * truth(200.0));
  EXPECT_NEAR(found.standard_error, 0.2 / std::sqrt(12.0), 0.006);
  EXPECT_NEAR(found.residuals[200], seconds[200] - found.at({rows(200, 0), rows(200, 1)}), 1e-9);
  int within = 0;
  for (int i = 0; i < 1000; ++i) {
    const double x = std::pow(10.0, 2.4e-3 * i);
    within += std::abs(truth(x) * share() - found.at({x, x * x})) < found.interval({x, x * x});
  }
  EXPECT_GT(within, 940);
  // A second for 1, 1300 for 1000: plain least squares listen to the second alone.
  const Eigen::Vector2d one(1.0, 1000.0), two(1.0, 1300.0);
  EXPECT_NEAR(fit(one, two).coefficients[0], 1.3, 1e-3);
  EXPECT_NEAR(fit_relative(one, two).coefficients[0], (1.0 + 1.0 / 1.3) / (1.0 + 1.0 / 1.69), 1e-12);
}

TEST(Regression, takes_nothing_for_what_took_no_time) {
  EXPECT_EQ(fit_relative(Eigen::MatrixXd::Ones(3, 1), Eigen::Vector3d::Zero()).coefficients[0], 0.0);
  const Regression found = fit_relative(Eigen::Vector3d(0.0, 100.0, 200.0), Eigen::Vector3d(0.0, 1.0, 2.0));
  EXPECT_NEAR(found.coefficients[0], 0.01, 1e-12);
}

// What a run of three robots on two edges measures, by laws that fits are to find; `scale` of how much each robot
// drove.
nlohmann::json summary_of(const std::string& mode, double scale) {
  using Json = nlohmann::json;
  const std::pair<const char*, const char*> kRobots[] = {{"a", "n"}, {"b", "n"}, {"c", "s"}};
  const double scans[] = {100 * scale, 300 * scale, 200 * scale};
  Json robots = Json::array(), lines = Json::array(), edges = Json::array();
  for (int i = 0; i < 3; ++i) {
    robots.push_back({{"id", kRobots[i].first}, {"scans", scans[i]}, {"mapped", true}});
    if (mode != "cloud-only") robots.back()["edge"] = kRobots[i].second;
    lines.push_back({{"id", kRobots[i].first},
                     {"packing_cpu_seconds", mode == "offload" ? 1e-5 * scans[i] : 0.0},
                     {"mapping_cpu_seconds", 0.002 * scans[i]},
                     {"sensed_bytes", mode == "offload" ? 500 * scans[i] : 0.0},
                     {"map_bytes", 1000 + 70 * scans[i]}});
  }
  robots.push_back({{"id", "d"}, {"scans", 900}, {"mapped", false}, {"edge", "s"}});
  lines.push_back(
      {{"id", "d"}, {"packing_cpu_seconds", 0}, {"mapping_cpu_seconds", 7}, {"sensed_bytes", 0}, {"map_bytes", 0}});
  // Robots a and b overlap, less the farther they drove, and so do b and c.
  const double of_a_and_b = 0.5 / std::sqrt(1.0 + scale), of_b_and_c = 0.05;
  const double shared_on_n = of_a_and_b * (scans[0] + scans[1]),
               shared = shared_on_n + of_b_and_c * (scans[1] + scans[2]);
  const Json overlaps = {{"a", "b", of_a_and_b}, {"b", "c", of_b_and_c}};
  double pairs = (scans[0] + scans[1]) * scans[2];
  double fusing_s = 0.25 + 0.001 * (scans[0] + scans[1] + scans[2]) + 0.02 * shared;
  if (mode != "cloud-only") {  // edges share what is between them
    const double judging_s = 3e-6 * pairs / 2.0;
    edges.push_back(
        {{"id", "n"},
         {"fusing_cpu_seconds", 0.004 * (scans[0] + scans[1]) + 2e-6 * scans[0] * scans[1] + 0.03 * shared_on_n},
         {"bytes", 1.5 * (2000 + 70 * (scans[0] + scans[1]))},
         {"judging_cpu_seconds", judging_s}});
    edges.push_back({{"id", "s"},
                     {"fusing_cpu_seconds", 0.004 * scans[2]},
                     {"bytes", 1.5 * (1000 + 70 * scans[2])},
                     {"judging_cpu_seconds", 0.9 * judging_s}});
  } else {
    pairs += scans[0] * scans[1];
    fusing_s += 3e-6 * pairs;
  }
  return {{"robots", robots},
          {"timeline",
           {{"mode", mode},
            {"robots", lines},
            {"edges", edges},
            {"overlaps", overlaps},
            {"cloud", {{"fusing_cpu_seconds", fusing_s}}}}}};
}

class ProfileOfRuns : public testing::Test {
 protected:
  std::filesystem::path run(const std::string& name, const nlohmann::json& summary) {
    std::filesystem::create_directories(folder_.path() / name);
    write_file(folder_.path() / name / "summary.json", summary.dump());
    return folder_.path() / name;
  }
  test::TemporaryFolder folder_;
};

TEST_F(ProfileOfRuns, learns_every_term_from_runs_that_offload) {
  const Profile profile = profile_runs({run("1", summary_of("offload", 1)), run("2", summary_of("offload", 2)),
                                        run("3", summary_of("offload", 5)), run("4", summary_of("offload", 7))});
  const LatencyModel& model = profile.model;
  EXPECT_DOUBLE_EQ(model.scans, 200.0 * (1 + 2 + 5 + 7) / 4);
  EXPECT_NEAR(model.pack_s_per_scan, 1e-5, 1e-12);
  EXPECT_NEAR(model.scan_bytes, 500.0, 1e-6);
  EXPECT_NEAR(model.slam_s_per_scan, 0.002, 1e-9);
  EXPECT_NEAR(model.map_bytes_fixed, 1000.0, 1e-3);
  EXPECT_NEAR(model.map_bytes_per_scan, 70.0, 1e-6);
  EXPECT_NEAR(model.edge_bytes_per_map_byte, 1.5, 1e-9);
  EXPECT_NEAR(model.edge_fusion.fixed_s, 0.0, 1e-6);
  EXPECT_NEAR(model.edge_fusion.per_scan_s, 0.004, 1e-8);
  EXPECT_NEAR(model.edge_fusion.per_scan_pair_s, 2e-6, 1e-11);
  EXPECT_NEAR(model.edge_fusion.per_shared_scan_s, 0.03, 1e-6);
  EXPECT_NEAR(model.cloud_fusion.fixed_s, 0.25, 1e-6);
  EXPECT_NEAR(model.cloud_fusion.per_scan_s, 0.001, 1e-8);
  EXPECT_NEAR(model.cloud_fusion.per_scan_pair_s, 3e-6, 1e-11);
  EXPECT_NEAR(model.cloud_fusion.per_shared_scan_s, 0.02, 1e-6);
  EXPECT_TRUE(profile.notes.empty());
  ASSERT_EQ(profile.terms.size(), 7u);
  for (const ProfiledTerm& term : profile.terms) EXPECT_LT(term.median_off, 1e-6) << term.name;
  EXPECT_EQ(profile.terms[4].name, "what edges send");
  EXPECT_EQ(profile.terms[4].shown.front().at, 1000.0 + 70.0 * 200.0);  // the edge of one robot
  EXPECT_EQ(profile.terms[5].shown.front().at, 200.0);
  EXPECT_NEAR(profile.terms[5].shown.front().value, 0.8, 1e-6);
}

TEST_F(ProfileOfRuns, learns_what_an_edge_has_of_its_own) {
  std::vector<std::filesystem::path> runs;
  for (const int factor : {1, 2, 5, 7}) {
    auto summary = summary_of("offload", factor);
    for (auto& line : summary["timeline"]["edges"])
      if (line["id"] == "s") {
        line["fusing_cpu_seconds"] = 3.0 * line["fusing_cpu_seconds"].get<double>();
        line["bytes"] = 0.5 * line["bytes"].get<double>();
      }
    runs.push_back(run(std::to_string(factor), summary));
  }
  const Profile profile = profile_runs(runs);
  const LatencyModel& model = profile.model;
  ASSERT_EQ(model.edges.size(), 2u);
  const EdgeLatency &n = model.edges.at("n"), &s = model.edges.at("s");
  EXPECT_NEAR(*n.bytes_per_map_byte, 1.5, 1e-9);
  EXPECT_NEAR(*s.bytes_per_map_byte, 0.75, 1e-9);
  EXPECT_NEAR(*s.slam_s_per_scan, 0.002, 1e-9);
  const FusedScans of_s{1000.0, 0.0, 0.0};
  EXPECT_NEAR(s.fusion->seconds(of_s), 12.0, 6.0);
  const LatencyModel few = profile_runs({runs[0], runs[1]}).model;
  EXPECT_TRUE(few.edges.empty() || !few.edges.begin()->second.fusion) << "two runs are not enough";
}

TEST_F(ProfileOfRuns, learns_from_each_mode_what_it_measures) {
  const LatencyModel unknown;
  const Profile onboard = profile_runs({run("1", summary_of("onboard", 1)), run("2", summary_of("onboard", 3))});
  EXPECT_EQ(onboard.model.scan_bytes, unknown.scan_bytes);
  EXPECT_EQ(onboard.model.pack_s_per_scan, unknown.pack_s_per_scan);
  EXPECT_NEAR(onboard.model.slam_s_per_scan, 0.002, 1e-9);
  EXPECT_NEAR(onboard.model.edge_fusion.per_scan_pair_s, 2e-6, 1e-11);
  EXPECT_EQ(onboard.notes.size(), 2u);  // packing and what robots send
  // Of 100, 300 and 200 scans, all three are paired in the cloud.
  const Profile alone = profile_runs({run("3", summary_of("cloud-only", 1)), run("4", summary_of("cloud-only", 2)),
                                      run("5", summary_of("cloud-only", 6)), run("6", summary_of("cloud-only", 9)),
                                      run("7", summary_of("cloud-only", 40))});
  EXPECT_EQ(alone.model.edge_fusion.per_scan_pair_s, unknown.edge_fusion.per_scan_pair_s);
  EXPECT_NEAR(alone.model.cloud_fusion.per_scan_pair_s, 3e-6, 1e-11);
  EXPECT_NEAR(alone.model.cloud_fusion.seconds({600.0, 110e3, 41.0}), 0.25 + 0.6 + 0.33 + 0.82, 1e-6);
}

TEST_F(ProfileOfRuns, leaves_out_maps_of_cameras_and_says_so) {
  nlohmann::json summary = summary_of("offload", 1);
  summary["robots"][2]["cameras"] = nlohmann::json::array({{{"frames", 3}}});
  const Profile profile = profile_runs({run("1", summary)});
  ASSERT_EQ(profile.terms.size(), 6u);                          // none of the cloud's
  EXPECT_EQ(profile.terms[1].regression.residuals.size(), 2u);  // what robots send
  EXPECT_EQ(profile.terms[2].regression.residuals.size(), 3u);  // SLAM is by lasers alone
  EXPECT_EQ(profile.terms[4].regression.residuals.size(), 1u);  // the edge of a and b
  EXPECT_EQ(profile.terms[5].regression.residuals.size(), 1u);
  EXPECT_THAT(profile.notes, testing::Contains(HasSubstr("cameras")));
}

TEST_F(ProfileOfRuns, passes_over_a_run_that_was_interrupted_and_says_so) {
  nlohmann::json interrupted = summary_of("offload", 1);
  interrupted.erase("timeline");
  const auto broken = run("broken", interrupted);
  const Profile profile = profile_runs({run("1", summary_of("offload", 1)), broken});
  EXPECT_EQ(profile.model.scans, 200.0);
  ASSERT_EQ(profile.notes.size(), 1u);
  EXPECT_THAT(profile.notes.front(), AllOf(HasSubstr("broken"), HasSubstr("no timeline")));
  try {
    profile_runs({broken});
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), AllOf(HasSubstr("broken"), HasSubstr("timeline")));
  }
}

TEST_F(ProfileOfRuns, names_the_summary_that_cannot_be_one) {
  EXPECT_THROW(profile_runs({folder_.path() / "none"}), Error);
  const auto refused = [&](const std::string& text) {
    write_file(folder_.path() / "summary.json", text);
    try {
      profile_runs({folder_.path()});
      ADD_FAILURE() << text;
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), HasSubstr("summary.json")) << text;
    }
  };
  for (const char* text : {"", "[]", "{}", R"({"robots": 3, "timeline": {}})", R"({"robots": [3], "timeline": {}})",
                           R"({"robots": [], "timeline": 3})", R"({"robots": [], "timeline": {"mode": 1}})",
                           R"({"robots": [{"id": "../x", "scans": 1, "mapped": true}], "timeline": {}})"})
    refused(text);
  const nlohmann::json good = summary_of("offload", 1);
  for (const char* at :
       {"/robots/0/scans", "/robots/0/mapped", "/robots/1/id", "/robots/1/edge", "/timeline/mode", "/timeline/robots",
        "/timeline/edges", "/timeline/cloud", "/timeline/robots/0", "/timeline/robots/0/id",
        "/timeline/robots/1/packing_cpu_seconds", "/timeline/robots/1/mapping_cpu_seconds",
        "/timeline/robots/1/sensed_bytes", "/timeline/robots/1/map_bytes", "/timeline/edges/0",
        "/timeline/edges/0/fusing_cpu_seconds", "/timeline/edges/0/bytes", "/timeline/cloud/fusing_cpu_seconds"})
    for (const nlohmann::json& wrong : {nlohmann::json(-1), nlohmann::json("a"), nlohmann::json(nullptr)}) {
      nlohmann::json bad = good;
      bad[nlohmann::json::json_pointer(at)] = wrong;
      if (bad.dump() != good.dump() && !(wrong == "a" && std::string(at) == "/robots/1/edge")) refused(bad.dump());
    }
}

}  // namespace
}  // namespace mapweave::scheduling
