#pragma once

#include "command.h"

namespace mapweave::app {

// evaluate convert: a trajectory in another form.
Action set_up_trajectory_conversion(CLI::App&);

}  // namespace mapweave::app
