// Trajectories and relations that others wrote: TUM, KITTI, EuRoC; links as they were measured.

#include "fuzz_target.h"

#include <mapweave/evaluation/relations.h>
#include <mapweave/evaluation/trajectory_file.h>
#include <mapweave/evaluation/tum_trajectory.h>
#include <mapweave/transport/link_model.h>

namespace mapweave::fuzz {
namespace {

using namespace evaluation;

const std::vector<Kind>& kinds() {
  static const std::vector<Kind> all = {
      {[](std::string_view bytes) { parse_tum(bytes, kWhere); },
       {"# stamps\n1.5 1 2 3 -0.5 0.5 -0.5 0.5\n2.5 1 2 3 0 0 0 1\n"}},
      {[](std::string_view bytes) { parse_trajectory(bytes, kWhere); },
       {"1.5 1 2 3 -0.5 0.5 -0.5 0.5\n", "0 0 1 1 -1 0 0 2 0 -1 0 3\n",
        "#timestamp,p_x,p_y,p_z,q_w,q_x,q_y,q_z\n1403636579758555392,1,2,3,0.5,0.5,-0.5,0.5,0,0,0\n"}},
      {[](std::string_view bytes) { parse_trajectory("0 0 1 1 -1 0 0 2 0 -1 0 3\n", kWhere, bytes); }, {"1.5\n"}},
      {[](std::string_view bytes) { parse_relations(bytes, kWhere); }, {"1.5 2.5 1 2 0 0 0 0.5\n"}},
      {[](std::string_view bytes) { transport::read_link_trace(scratch_file("link.csv", bytes), {}); },
       {"0,1e6,0.02,0,0\n5,2.5e5,0.1,0.01,0.01\n"}}};
  return all;
}

}  // namespace

std::vector<std::string> seeds() { return seeds_of(kinds()); }
void decode(std::string_view bytes) { decode_one_of(kinds(), bytes); }

}  // namespace mapweave::fuzz
