#pragma once
// The workers that map robots of a run: how a run finds them over a NATS server.

#include <mapweave/runtime/cluster.h>
#include <mapweave/runtime/nats_wires.h>

#include <chrono>
#include <map>
#include <optional>
#include <string>

namespace mapweave::app {

class WorkersOfCluster {
 public:
  // By the configuration's `live`, but at this address. Throws what NatsWires throws.
  WorkersOfCluster(const runtime::RunConfiguration& configuration, const std::string& broker);
  const runtime::Cluster& cluster() const { return cluster_; }

 private:
  runtime::NatsWires wires_;
  transport::NatsBoard board_;
  struct LastWord {
    std::chrono::system_clock::time_point said;                    // by the broker's clock
    std::optional<std::chrono::steady_clock::time_point> renewed;  // when it was last noticed that it said more
  };
  std::map<std::string, LastWord> words_;
  runtime::Cluster cluster_;
};

}  // namespace mapweave::app
