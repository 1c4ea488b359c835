#include "command.h"
#include "command_line.h"

#include <mapweave/core/worker_pool.h>

namespace mapweave::app {

void add_writing_flags(CLI::App& verb, WritingFlags& flags) {
  verb.add_option("-o,--out", flags.out, "new folder for the results")->required()->type_name("DIR");
  verb.add_option("--threads", flags.threads, "threads to use; 0: one per processor. Results do not depend on it")
      ->check(whole_number(0, 1024))
      ->type_name("N");
  verb.add_option("--seed", flags.seed, "seed of all random numbers")
      ->check(whole_number(0, 4294967295))
      ->type_name("S");
  verb.add_option("--set", flags.set,
                  "sets one option: key=value, as in laser.engine=icp (see: mapweave config reference)")
      ->type_name("KEY=VALUE")
      ->allow_extra_args(false);
  verb.add_flag("--force", flags.force, "replace an old folder of results");
  verb.add_flag("--json", flags.json, "print the summary as JSON");
}

int threads_of(const WritingFlags& flags) { return flags.threads > 0 ? flags.threads : available_processors(); }

}  // namespace mapweave::app
