// mapweave merge: several robots' maps, and grids of others, -> one team map.

#include "configuration.h"

#include <mapweave/core/files.h>
#include <mapweave/runtime/merge_runner.h>

#include <memory>

namespace mapweave::app {

Action set_up_merge(CLI::App& verb) {
  struct Arguments {
    std::vector<std::filesystem::path> maps;
    WritingFlags flags;
  };
  const auto arguments = std::make_shared<Arguments>();
  verb.add_option(
          "MAPS", arguments->maps,
          "map.mwdb files of mapweave, journals of live map servers (.mwj) and map_server grids (.yaml), mixed; each is named by its "
          "file's stem")
      ->required()
      ->type_name("MAP.mwdb|MAP.mwj|MAP.yaml");
  add_writing_flags(verb, arguments->flags);
  return [arguments] {
    const LoadedConfiguration loaded = load_configuration({}, {}, arguments->flags);
    expect_outside(arguments->flags.out, arguments->maps);
    WorkerPool pool(threads_of(arguments->flags));
    const auto progress = make_terminal_progress();
    const runtime::MergeSettings settings{arguments->flags.out, arguments->flags.force};
    return tell(runtime::run_merge(loaded.configuration, arguments->maps, settings, pool, *progress), arguments->flags.out,
                arguments->flags.json);
  };
}

}  // namespace mapweave::app
