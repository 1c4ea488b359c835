// What `mapweave plan` reads: problems, and models of latency, as JSON.

#include "fuzz_target.h"

#include <mapweave/scheduling/latency_model.h>
#include <mapweave/scheduling/problem.h>

namespace mapweave::fuzz {
namespace {

using namespace scheduling;

const std::vector<Kind>& kinds() {
  static const std::vector<Kind> all = {
      {[](std::string_view bytes) { parse_problem(bytes, kWhere); },
       {R"({"robots": ["r0", "r1", "r2"], "overlaps": [["r0", "r1", 0.31], ["r2", "r0", 0]],
    "edges": [{"id": "e0", "bandwidth_bytes_per_s": 2.5e6},
              {"id": "e1", "bandwidth_bytes_per_s": 1e6, "speed": 0.5, "capacity": 2, "delay_s": 0.1}],
    "cloud": {"speed": 4, "edges_judge": false}, "robot_scans": {"r1": 1200}, "links": [["r2", "e1", 1e6, 0.02]]})"}},
      {[](std::string_view bytes) {
         const std::string json = model_json(parse_model(bytes, kWhere));
         expect(model_json(parse_model(json, kWhere)) == json, "a model comes back as it was");
       },
       {R"({"edges": {"f": {"fusion": {"fixed_s": 2}}}})", model_json(LatencyModel())}}};
  return all;
}

}  // namespace

std::vector<std::string> seeds() { return seeds_of(kinds()); }
void decode(std::string_view bytes) { decode_one_of(kinds(), bytes); }

}  // namespace mapweave::fuzz
