#pragma once
// The engine `graph`: scans matched to submaps under way, frozen submaps, loops by judgement, a pose graph, and at the
// end every scan matched again to the submaps around it. Bounded by what the robot saw, not by how long it ran.

#include <mapweave/laser/graph_options.h>
#include <mapweave/laser/laser_mapper.h>

#include <memory>

namespace mapweave::laser {

class GraphMapper : public LaserMapper {
 public:
  GraphMapper(ClientId client, const GraphMapperOptions& options);
  ~GraphMapper() override;
  void add(const LaserInput&) override;
  void finish() override;
  Map snapshot() const override;
  std::vector<LivePose> take_live_poses() override;
  std::vector<std::string> notes() const override;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace mapweave::laser
