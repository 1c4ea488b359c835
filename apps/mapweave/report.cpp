// mapweave report: a folder of results -> one page for a browser.

#include "command.h"
#include "output_file.h"

#include <mapweave/runtime/results_page.h>

#include <iostream>
#include <memory>

namespace mapweave::app {

Action set_up_report(CLI::App& verb) {
  struct Arguments {
    std::filesystem::path results, out, reference;
  };
  const auto arguments = std::make_shared<Arguments>();
  verb.add_option("DIR", arguments->results, "folder of results of run, slam or merge; parts of it may be missing")
      ->required()
      ->type_name("DIR");
  verb.add_option("-o,--out", arguments->out, "the page; without it DIR/report.html")->type_name("FILE.html");
  verb.add_option(
          "--reference", arguments->reference,
          "true trajectories, which the page compares with the estimated ones: a TUM file, or of several robots "
          "a folder with a file ROBOT.tum or ROBOT.truth.tum for each")
      ->type_name("FILE.tum|DIR");
  return [arguments] {
    const std::filesystem::path page = arguments->out.empty() ? arguments->results / "report.html" : arguments->out;
    const OutputFile output{page, {arguments->reference}, ".html"};
    expect_free(output);
    write_output(output, runtime::results_page(arguments->results, arguments->reference));
    std::cout << "page: " << page.string() << '\n';
    return ExitCode::done;
  };
}

}  // namespace mapweave::app
