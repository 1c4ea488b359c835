#pragma once
// What main() drives: scans in, a pose for each of them out.

#include "scan_motion.h"

#include <mapweave/laser/mrpt_options.h>

#include <memory>
#include <vector>

namespace mapweave::mrpt_mapper {

class Engine {
 public:
  virtual void add(const MovedScan&) = 0;
  // map_from_robot of every scan that was added, in order.
  virtual std::vector<Pose2> trajectory() = 0;
  virtual ~Engine() = default;
};

constexpr int kMinReturns = 10;          // scans with fewer are placed by their motion alone
constexpr double kBytesPerPoint = 60.0;  // of a map of points, with a point's share of the search tree

std::unique_ptr<Engine> make_engine(const laser::RbpfOptions&);
std::unique_ptr<Engine> make_engine(const laser::IcpOptions&);

}  // namespace mapweave::mrpt_mapper
