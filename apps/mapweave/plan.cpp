// mapweave plan: which robot to which edge. mapweave profile: what runs took, as the latency model that plan predicts
// with.

#include "command.h"
#include "command_line.h"
#include "output_file.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/report/plan_page.h>
#include <mapweave/runtime/json_text.h>
#include <mapweave/runtime/manifest.h>
#include <mapweave/runtime/problem_of_run.h>
#include <mapweave/scheduling/plan.h>
#include <mapweave/scheduling/profile.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <iostream>
#include <memory>

namespace mapweave::app {
namespace {

using Json = nlohmann::ordered_json;
namespace scheduling = ::mapweave::scheduling;

struct PlanArguments {
  std::filesystem::path problem, model, page;
  std::string method = "default", search = "printed";
  scheduling::PlanOptions options;
  bool json = false, compare = false;
};

// Of a name that the command line checked.
template <class Choice>
Choice choice_of(const std::vector<std::string>& names, const std::string& name) {
  return static_cast<Choice>(std::find(names.begin(), names.end(), name) - names.begin());
}

Json json_of(const scheduling::Problem& problem, const scheduling::Plan& plan, const std::string& method) {
  Json groups = Json::array(), placement = Json::object();
  for (const auto& group : plan.groups) {
    Json names = Json::array();
    for (const std::uint32_t robot : group) names.push_back(problem.robots[robot].str());
    groups.push_back(names);
  }
  for (std::size_t robot = 0; robot < problem.robots.size(); ++robot)
    placement[problem.robots[robot].str()] = problem.edges[plan.edge_of[robot]].id.str();
  Json result = {{"groups", groups},
                 {"placement", placement},
                 {"cut_weight", plan.cut_weight},
                 {"in_group_weight", plan.in_group_weight},
                 {"predicted_seconds", plan.predicted_seconds},
                 {"lower_bound_seconds", plan.lower_bound_seconds},
                 {"algorithm_seconds", plan.algorithm_seconds},
                 {"method", method}};
  if (plan.further_edges_of.empty()) return result;
  for (std::size_t robot = 0; robot < problem.robots.size(); ++robot)
    for (const std::uint32_t edge : plan.further_edges_of[robot])
      result["further_placement"][problem.robots[robot].str()].push_back(problem.edges[edge].id.str());
  return result;
}

void print(const Json& plan) {
  std::printf("method %s: %zu robots in %zu groups\n", plan["method"].get_ref<const std::string&>().c_str(),
              plan["placement"].size(), plan["groups"].size());
  for (const Json& group : plan["groups"]) {
    std::string line = plan["placement"][group.front().get<std::string>()].get<std::string>() + ":";
    for (const Json& robot : group) line += " " + robot.get<std::string>();
    std::printf("  %s\n", line.c_str());
  }
  if (const auto further = plan.find("further_placement"); further != plan.end())
    for (const auto& [robot, edges] : further->items()) {
      std::string line;
      for (const Json& edge : edges) line += (line.empty() ? "" : ", ") + edge.get<std::string>();
      std::printf("  %s also to %s\n", robot.c_str(), line.c_str());
    }
  std::printf("overlap within groups %.4g, cut %.4g\n", plan["in_group_weight"].get<double>(),
              plan["cut_weight"].get<double>());
  std::printf("the global map after %.3g s as predicted; no plan is below %.3g s; decided in %.2g s\n",
              plan["predicted_seconds"].get<double>(), plan["lower_bound_seconds"].get<double>(),
              plan["algorithm_seconds"].get<double>());
}

// What every method makes of the problem; of recslam each search (RecSLAM fig. 16).
Json compared(const scheduling::Problem& problem, scheduling::PlanOptions options) {
  Json rows = Json::array();
  const auto add = [&](const std::string& label) {
    try {
      const scheduling::Plan plan = scheduling::make_plan(problem, options);
      rows.push_back({{"method", label},
                      {"cut_weight", plan.cut_weight},
                      {"predicted_seconds", plan.predicted_seconds},
                      {"algorithm_seconds", plan.algorithm_seconds}});
    } catch (const Error& error) {
      rows.push_back({{"method", label}, {"not_possible", error.problem()}});
    }
  };
  const auto& methods = scheduling::plan_method_names();
  for (const std::string& method : methods) {
    options.method = choice_of<scheduling::PlanMethod>(methods, method);
    if (options.method != scheduling::PlanMethod::recslam) {
      add(method);
      continue;
    }
    const auto& searches = scheduling::recslam_search_names();
    for (const std::string& search : searches) {
      options.recslam.search = choice_of<scheduling::RecslamSearch>(searches, search);
      add(method + ", search " + search);
    }
  }
  return rows;
}

void print_compared(const Json& rows) {
  std::printf("%-24s %10s %12s %12s\n", "method", "cut", "predicted s", "decided in s");
  for (const Json& row : rows) {
    const char* method = row["method"].get_ref<const std::string&>().c_str();
    if (const auto why = row.find("not_possible"); why != row.end())
      std::printf("%-24s not possible: %s\n", method, why->get_ref<const std::string&>().c_str());
    else
      std::printf("%-24s %10.4g %12.3g %12.2g\n", method, row["cut_weight"].get<double>(),
                  row["predicted_seconds"].get<double>(), row["algorithm_seconds"].get<double>());
  }
}

ExitCode plan(PlanArguments arguments) {
  arguments.options.method = choice_of<scheduling::PlanMethod>(scheduling::plan_method_names(), arguments.method);
  arguments.options.recslam.search =
      choice_of<scheduling::RecslamSearch>(scheduling::recslam_search_names(), arguments.search);
  if (!arguments.model.empty()) arguments.options.model = scheduling::read_model(arguments.model);
  std::error_code ignored;
  const scheduling::Problem problem = std::filesystem::is_directory(arguments.problem, ignored)
                                          ? runtime::problem_of_run(arguments.problem)
                                          : scheduling::read_problem(arguments.problem);
  if (arguments.compare) {
    const Json rows = compared(problem, arguments.options);
    if (arguments.json)
      std::cout << runtime::json_text({{"compared", rows}}) << '\n';
    else
      print_compared(rows);
    return ExitCode::done;
  }
  const scheduling::Plan plan = scheduling::make_plan(problem, arguments.options);
  if (!arguments.page.empty())
    write_output({arguments.page, {arguments.problem, arguments.model}, ".html"},
                 report::plan_page(problem, arguments.options, plan,
                                   {arguments.problem, arguments.model, runtime::program_version()}));
  const Json result = json_of(problem, plan, arguments.method);
  if (arguments.json) {
    std::cout << runtime::json_text(result) << '\n';
    return ExitCode::done;
  }
  print(result);
  if (!arguments.page.empty()) std::cout << "page: " << arguments.page.string() << '\n';
  return ExitCode::done;
}

struct ProfileArguments {
  std::vector<std::filesystem::path> runs;
  std::filesystem::path out;
  bool json = false;
};

Json json_of(const scheduling::ProfiledTerm& term) {
  Json points = Json::array();
  for (std::size_t i = 0; i < term.samples.size(); ++i)
    points.push_back(
        {{"at", term.samples[i].at},
         {"measured", term.samples[i].measured},
         {"fitted", term.samples[i].measured - term.regression.residuals[i]},
         {"half_width", std::isfinite(term.samples[i].half_width) ? Json(term.samples[i].half_width) : Json()}});
  return {{"term", term.name},
          {"by", term.basis},
          {"unit", term.unit},
          {"samples", term.regression.residuals.size()},
          {"coefficients", term.regression.coefficients},
          {"relative_standard_error", term.regression.standard_error},
          {"median_off", term.median_off},
          {"r_squared", term.regression.r_squared},
          {"residuals", term.regression.residuals},
          {"points", points}};
}

ExitCode profile(const ProfileArguments& arguments) {
  const scheduling::Profile profile = scheduling::profile_runs(arguments.runs);
  const std::string model = scheduling::model_json(profile.model);
  if (!arguments.out.empty()) write_output({arguments.out, {}, ".json"}, model);
  if (arguments.json) {
    Json terms = Json::array();
    for (const auto& term : profile.terms) terms.push_back(json_of(term));
    std::cout << runtime::json_text({{"model", Json::parse(model)}, {"terms", terms}, {"notes", profile.notes}})
              << '\n';
    return ExitCode::done;
  }
  for (const auto& term : profile.terms) {
    const char* unit = term.unit.c_str();
    std::printf("%s, by %s (%zu samples): half are within %.2g %%, explains %.0f %%\n", term.name.c_str(),
                term.basis.c_str(), term.regression.residuals.size(), 100.0 * term.median_off,
                100.0 * term.regression.r_squared);
    for (const auto& point : term.shown) {
      std::printf("  %g %s: %.3g %s", point.at, term.basis.c_str(), point.value, unit);
      if (std::isfinite(point.half_width)) std::printf(" +- %.2g (95 of 100 runs)", point.half_width);
      std::printf("\n");
    }
  }
  for (const std::string& note : profile.notes) std::printf("note: %s\n", note.c_str());
  std::cout << model;
  return ExitCode::done;
}

// As libs/scheduling/README.md says it at length.
constexpr const char* kProblemForm = R"(

PROBLEM.json:
  {"robots": ["r0", "r1", "r2"],
   "overlaps": [["r0", "r1", 0.31], ["r1", "r2", 0.05]],
   "edges": [{"id": "e0", "bandwidth_bytes_per_s": 2.5e6, "speed": 1.0, "capacity": null},
             {"id": "e1", "bandwidth_bytes_per_s": 1e6, "delay_s": 0.05}],
   "cloud": {"speed": 4.0, "edges_judge": true},
   "robot_scans": {"r0": 1200},
   "links": [["r0", "e0", 2.5e6, 0.005]]}
overlaps: degrees |A and B| / (|A| + |B|), 0 to 0.5, each pair once. edges: bandwidth and delay to the
cloud; speed relative to the latency model's processor; capacity: most robots. links: robot, edge,
bytes a second, seconds. cloud, robot_scans, links and all of an edge but its id and bandwidth may be left out.)";

}  // namespace

Action set_up_plan(CLI::App& verb) {
  const auto arguments = std::make_shared<PlanArguments>();
  verb.add_option("PROBLEM", arguments->problem,
                  "robots, overlaps of their maps and edges as JSON, see below; or a folder of results of `mapweave "
                  "run`: what its maps shared, its scans, edges and links")
      ->required()
      ->type_name("PROBLEM.json|RUN_DIR");
  verb.add_option("--method", arguments->method,
                  "default, recslam (the paper's algorithms), greedy, random, metis, or exact (16 robots at most)")
      ->check(one_of(scheduling::plan_method_names()))
      ->capture_default_str();
  verb.add_option("--seed", arguments->options.seed, "seed of random numbers")
      ->check(whole_number(0, 4294967295))
      ->capture_default_str();
  verb.add_option("--recslam-search", arguments->search,
                  "how method recslam improves its first groups: none, printed (Algorithm 2 as its listing is printed, "
                  "whose tabu list is never read), or tabu (as its text means it)")
      ->check(one_of(scheduling::recslam_search_names()))
      ->capture_default_str();
  verb.add_option("--kappa", arguments->options.recslam.iterations,
                  "iterations of Algorithm 2; larger values search longer")
      ->check(whole_number(0, 1000000))
      ->capture_default_str();
  verb.add_option("--tau", arguments->options.recslam.tabu_length,
                  "swaps that its tabu list holds; larger values forbid the last swaps for longer")
      ->check(whole_number(0, 1000000))
      ->capture_default_str();
  CLI::Option* compare =
      verb.add_flag("--compare", arguments->compare, "print a table of what every method makes of the problem");
  verb.add_option("--model", arguments->model, "latency model as `mapweave profile --out` writes it")
      ->type_name("FILE");
  verb.add_option("--edges-per-robot", arguments->options.edges_per_robot,
                  "partial offloading: to how many edges each robot sends its data")
      ->check(whole_number(1, 1000))
      ->capture_default_str();
  verb.add_option("--report", arguments->page, "write a page for a browser that shows the plan")
      ->type_name("FILE.html")
      ->excludes(compare);
  verb.add_flag("--json", arguments->json, "print JSON");
  verb.footer(verb.get_footer() + kProblemForm);
  return [arguments] { return plan(*arguments); };
}

Action set_up_profile(CLI::App& verb) {
  const auto arguments = std::make_shared<ProfileArguments>();
  verb.add_option("RUN_DIR", arguments->runs, "folders of results of `mapweave run`")->required();
  verb.add_option("-o,--out", arguments->out, "write the model there, for `mapweave plan --model`")->type_name("FILE");
  verb.add_flag("--json", arguments->json, "print JSON");
  return [arguments] { return profile(*arguments); };
}

}  // namespace mapweave::app
