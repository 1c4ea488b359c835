#pragma once
// The configuration of a program that runs, read again where its user asks (SIGHUP).

#include "serve.h"

namespace mapweave::app {

class ConfigurationReload {
 public:
  ConfigurationReload(RoleArguments arguments, const Deployment& deployment, StopSignals& signals)
      : arguments_(std::move(arguments)), now_(deployment.loaded.configuration), signals_(signals) {}
  // Now and then. What the program is to take (LiveOptions::take_while_running), each time that it was asked for. Says
  // what changed, and what else was changed in vain until the next start. Nothing where the configuration cannot be
  // read, which is said, too.
  std::optional<runtime::LiveOptions> look();

 private:
  const RoleArguments arguments_;
  runtime::RunConfiguration now_;
  StopSignals& signals_;
};

}  // namespace mapweave::app
