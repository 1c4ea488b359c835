#pragma once
// The robot's role, mode offload: packs what it sensed, for exactly one edge (RecSLAM III-B). A state machine: no
// thread, no clock, no file.

#include <mapweave/core/error.h>
#include <mapweave/laser/scan_input.h>
#include <mapweave/maps/exchange.h>

#include <optional>
#include <string>

namespace mapweave::tiers {

class RobotAgent {
 public:
  // `stream`: what the records come from, for messages; the robot's name where it is empty.
  explicit RobotAgent(RobotId robot, laser::ScanInputOptions options = {}, std::string stream = {});

  // The next record of the robot's own stream; nullopt where it is of no use to a laser mapper. Throws Error(kBadInput)
  // where time runs backwards; the stream should then end.
  std::optional<Sensed> step(const rawlog::Record&);
  // The stream ends, early where there is trouble. A stream without a laser scan is trouble. Called once.
  Sensed end(std::optional<Error> trouble = {});

  std::uint64_t scans() const { return scans_; }
  double seconds() const { return scans_ == 0 ? 0.0 : seconds_between(first_, last_); }  // of data, first to last scan
  const laser::ScanPacker& packer() const { return packer_; }

 private:
  RobotId robot_;
  std::string stream_;
  laser::ScanPacker packer_;
  std::uint64_t sequence_ = 0, scans_ = 0;
  Stamp first_, last_;           // of scans
  std::optional<Stamp> latest_;  // of anything
  bool ended_ = false;
};

}  // namespace mapweave::tiers
