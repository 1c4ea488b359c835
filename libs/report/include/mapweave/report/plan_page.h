#pragma once
// One page that shows a plan: groups, predicted times, loads, links, bound. A single HTML file that loads nothing.

#include <mapweave/scheduling/plan.h>

#include <filesystem>
#include <string>

namespace mapweave::report {

// What the plan was made of, for "make it again".
struct PlanSource {
  std::filesystem::path problem;  // PROBLEM.json, or a folder of results of `run`
  std::filesystem::path model;    // latency model; empty: the program's own
  std::string program_version;
};

// `plan` is what make_plan() makes of the problem with these options. Equal plans give equal pages: nothing in it
// depends on clocks. Names are never executed. Of more than 4000 overlaps the largest are drawn. Throws Error kMissing
// where a source cannot be read.
std::string plan_page(const scheduling::Problem&, const scheduling::PlanOptions&, const scheduling::Plan&,
                      const PlanSource&);

}  // namespace mapweave::report
