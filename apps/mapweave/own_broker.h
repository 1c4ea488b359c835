#pragma once
// The broker of a deployment that names none: a child of the cloud's program, for programs of this machine alone.

#include <mapweave/core/progress.h>
#include <mapweave/runtime/run_configuration.h>
#include <mapweave/transport/broker.h>

#include <filesystem>
#include <optional>

namespace mapweave::app {

class OwnBroker {
 public:
  // Starts none where the configuration names a broker, where one answers already, or where there is no nats-server:
  // then it is said who does not answer, as for every other broker. Its streams lie below live.store, and are there
  // again after a kill. Throws Error as transport::Broker.
  OwnBroker(const runtime::RunConfiguration& configuration, const runtime::RunPlan& plan, Progress& progress);
  ~OwnBroker();
  OwnBroker(const OwnBroker&) = delete;
  OwnBroker& operator=(const OwnBroker&) = delete;

  // The results are written: its streams go when it ends.
  void forget() { is_done_ = true; }

 private:
  std::filesystem::path folder_;
  std::optional<transport::Broker> broker_;
  bool is_done_ = false;
};

}  // namespace mapweave::app
