// mapweave explain: why two maps were merged or stayed apart.

#include "command.h"
#include "command_line.h"
#include "output_file.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/runtime/explanation.h>

#include <iostream>
#include <memory>

namespace mapweave::app {

Action set_up_explain(CLI::App& verb) {
  struct Arguments {
    std::filesystem::path results, out;
    std::string a, b;
    int threads = 0;
  };
  const auto arguments = std::make_shared<Arguments>();
  verb.add_option("DIR", arguments->results, "folder of results of run or merge")->required()->type_name("DIR");
  verb.add_option("A", arguments->a, "a robot's map, as merges.json names it")->required()->type_name("A");
  verb.add_option("B", arguments->b, "another one")->required()->type_name("B");
  verb.add_option("-o,--out", arguments->out, "the picture; without it DIR/explain-A-B.png")->type_name("FILE.png");
  verb.add_option("--threads", arguments->threads, "threads to use; 0: one per processor")
      ->check(whole_number(0, 1024))
      ->type_name("N");
  return [arguments] {
    WritingFlags flags;
    flags.threads = arguments->threads;
    WorkerPool pool(threads_of(flags));
    const runtime::Explanation explanation = runtime::explain(arguments->results, arguments->a, arguments->b, {}, pool);
    std::cout << explanation.text;
    if (explanation.png.empty()) {
      std::cout << "no picture: the maps have no walls of lasers\n";
      return ExitCode::done;
    }
    const std::filesystem::path picture =
        arguments->out.empty() ? arguments->results / ("explain-" + explanation.a + "-" + explanation.b + ".png")
                               : arguments->out;
    write_output({picture, {}, ".png"}, explanation.png);
    std::cout << "picture: " << picture.string() << '\n';
    return ExitCode::done;
  };
}

}  // namespace mapweave::app
