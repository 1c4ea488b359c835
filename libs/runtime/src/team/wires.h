#pragma once
// The wires of a run in virtual time, each made when it is first used.

#include <mapweave/core/mixed_bits.h>
#include <mapweave/runtime/timeline.h>

#include <map>
#include <string>
#include <utility>

namespace mapweave::runtime {

class Wires {
 public:
  explicit Wires(const TimelineOptions& options) : options_(options) {}

  // Times are since the recordings ended.
  double send(const std::string& from, const std::string& to, const transport::LinkModelOptions& otherwise, double at_s,
              std::uint64_t bytes) {
    auto known = wires_.find({from, to});
    if (known == wires_.end()) {
      std::uint64_t seed = options_.seed;  // one of its own for each wire
      for (const char letter : from + ">" + to) seed = mixed(seed ^ static_cast<unsigned char>(letter));
      known = wires_
                  .emplace(std::make_pair(from, to),
                           transport::LinkModel(wire_between(options_.network, from, to, otherwise), seed))
                  .first;
    }
    return known->second.send(options_.recorded_s + at_s, bytes) - options_.recorded_s;
  }

 private:
  const TimelineOptions& options_;
  std::map<std::pair<std::string, std::string>, transport::LinkModel> wires_;
};

}  // namespace mapweave::runtime
