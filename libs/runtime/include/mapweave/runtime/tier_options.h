#pragma once
// What the configuration says of the tiers: who maps and who merges, the wires between them, their processors, and the
// cloud.

#include <mapweave/core/options.h>
#include <mapweave/runtime/rounds.h>
#include <mapweave/tiers/edge_server.h>
#include <mapweave/transport/link_model.h>

#include <string>
#include <vector>

namespace mapweave::runtime {

// Who maps and who merges: offload: edges map what robots sensed, and merge; onboard: robots map, edges merge;
// cloud_only: robots map, the cloud merges alone.
enum class Mode { offload, onboard, cloud_only };

// A wire between two named programs.
struct LinkEntry : transport::LinkModelOptions {
  std::string from, to;
  template <class Visitor>
  void describe(Visitor& v) {
    v.text("from", from, "sender on the link: a robot or an edge; or 'cloud', for what the cloud sends to robots");
    v.text("to", to, "receiver on the link: an edge or 'cloud'; or a robot, for what it is sent of the team's map");
    transport::LinkModelOptions::describe(v);
  }
};

struct NetworkOptions {
  transport::LinkModelOptions robot_edge, robot_cloud, edge_cloud;
  std::vector<LinkEntry> links;
  template <class Visitor>
  void describe(Visitor& v) {
    v.section("robot_edge", robot_edge, "link from each robot to its edge");
    v.section("robot_cloud", robot_cloud,
              "link between each robot and the cloud (mode cloud-only, and robots without an edge)");
    v.section("edge_cloud", edge_cloud, "link from each edge to the cloud");
    v.list("links", links, "single links that differ from the common ones");
  }
};

// The wire between these two, else the common one.
const transport::LinkModelOptions& wire_between(const NetworkOptions&, const std::string& from, const std::string& to,
                                                const transport::LinkModelOptions& otherwise);

// Speed of one core of each tier, relative to a core of this machine.
struct ProcessorOptions {
  using Profile = transport::ProcessorProfile;
  Profile robot_profile = Profile::this_machine, edge_profile = Profile::this_machine,
          cloud_profile = Profile::this_machine;
  double robot = 1.0, edge = 1.0, cloud = 1.0;
  double robot_speed() const { return speed_of(robot_profile) * robot; }
  double edge_speed() const { return speed_of(edge_profile) * edge; }
  double cloud_speed() const { return speed_of(cloud_profile) * cloud; }
  template <class Visitor>
  void describe(Visitor& v) {
    const auto tier = [&v](const char* name, const char* speed_name, Profile& profile, double& speed, const char* doc,
                           const char* speed_doc) {
      v.choice(name, profile,
               {{"this-machine", Profile::this_machine},
                {"raspberry-pi-3b-plus", Profile::raspberry_pi_3b_plus},
                {"jetson-tx2", Profile::jetson_tx2}},
               doc);
      v.positive(speed_name, speed, speed_doc);
    };
    tier("robot_profile", "robot", robot_profile, robot,
         "processor of each robot; this-machine: as fast as the one that runs the program",
         "speed of each robot's processor as a multiple of its profile's; larger values are faster");
    tier("edge_profile", "edge", edge_profile, edge,
         "processor of each edge; this-machine: as fast as the one that runs the program",
         "speed of the edges' processors as a multiple of their profile's; larger values are faster");
    tier("cloud_profile", "cloud", cloud_profile, cloud,
         "processor of the cloud; this-machine: as fast as the one that runs the program",
         "speed of the cloud's processor as a multiple of its profile's; larger values are faster");
  }
};

// Where everything is merged, and who receives the result.
struct CloudEntry {
  std::string at;
  std::vector<std::string> push_to;
  bool edges_judge = true;
  tiers::EdgeMapOptions maps;
  RoundOptions rounds;
  template <class Visitor>
  void describe(Visitor& v) {
    v.text("at", at,
           "edge that also does the cloud's work, merging the maps of all edges; empty: the cloud is a machine of its "
           "own");
    v.texts("push_to", push_to, "robots that are sent the team's map at the end, with which their next run can begin");
    v.flag("edges_judge", edges_judge,
           "edges compare the maps of robots on different edges, shared out evenly; false: the cloud compares them "
           "itself. The maps are "
           "the same");
    v.flag("thin_maps", maps.thin,
           "edges send of their robots' laser maps the scans that show each place, and all poses and constraints as "
           "they solved them; false: they send the whole maps, which takes several times the bytes");
    v.section("thinning", maps.thinning, "which scans edges leave out");
    v.section("rounds", rounds,
              "previews while robots drive: edges fuse what their robots have so far, the cloud what edges have. The "
              "final map is the same with and without");
  }
};

}  // namespace mapweave::runtime
