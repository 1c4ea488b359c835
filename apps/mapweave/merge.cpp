// mapweave merge: several robots' maps, and grids of others, -> one team map.

#include "configuration.h"

#include <mapweave/core/files.h>
#include <mapweave/runtime/merge_runner.h>

#include <memory>

namespace mapweave::app {

Action set_up_merge(CLI::App& verb) {
  struct Arguments {
    std::vector<std::filesystem::path> maps;
    std::vector<std::string> without, refused, vetoed, anchors;
    std::string frame;
    bool forget = false;
    WritingFlags flags;
  };
  const auto arguments = std::make_shared<Arguments>();
  verb.add_option(
          "MAPS", arguments->maps,
          "the first one gives the frame; map.mwdb files of mapweave, journals of live camera map servers (.mwj) and "
          "map_server grids (.yaml), mixed; each "
          "is named by its "
          "file's stem. A team's map.mwdb, or a folder of results, stands for the robots' own maps that it was made of")
      ->required()
      ->type_name("MAP.mwdb|MAP.mwj|MAP.yaml|DIR");
  verb.add_option("--frame", arguments->frame,
                  "the merged map's frame: a map's or robot's name; walls (axes along the walls); or three numbers in "
                  "metres and radians, where the first map's frame lies in it. Without it: the first map's, so that "
                  "what is merged into yesterday's map leaves it in place")
      ->type_name("MAP|walls|x,y,yaw");
  verb.add_option("--without", arguments->without,
                  "leave this robot out: the result is what it would be without it; repeatable")
      ->type_name("ROBOT")
      ->allow_extra_args(false);
  verb.add_option("--refuse", arguments->refused, "never match the maps of these two robots to each other; repeatable")
      ->type_name("A,B")
      ->allow_extra_args(false);
  verb.add_option("--veto", arguments->vetoed,
                  "do not believe this judgement, which merges.json names among a pair's witnesses: what rests on it "
                  "stays apart; repeatable")
      ->type_name("ID")
      ->allow_extra_args(false);
  verb.add_option("--anchor", arguments->anchors,
                  "a prior: where B's map frame (where B began) lies in A's, in metres and radians, with its standard "
                  "deviation (0.5 m; "
                  "0.1 rad). Walls may contradict it, and a note says so; repeatable")
      ->type_name("A,B,x,y,yaw[,sigma[,sigma_yaw]]")
      ->allow_extra_args(false);
  verb.add_flag(
      "--forget-requests", arguments->forget,
      "drop what was said when the given teams were made (refusals, vetoes, priors, starts, options of fusion); else "
      "it holds again");
  add_writing_flags(verb, arguments->flags);
  return [arguments] {
    runtime::MergeRequests requests;
    requests.without = arguments->without;
    for (const std::string& pair : arguments->refused) requests.refused.push_back(runtime::parse_pair(pair));
    for (const std::string& id : arguments->vetoed) requests.vetoed.insert(runtime::parse_veto(id));
    for (const std::string& anchor : arguments->anchors) requests.anchors.push_back(runtime::parse_anchor(anchor));
    std::vector<std::string> frame;
    if (!arguments->frame.empty()) frame.push_back("team.frame=" + arguments->frame);
    const LoadedConfiguration loaded = load_configuration({}, frame, arguments->flags);
    expect_outside(arguments->flags.out, arguments->maps);
    WorkerPool pool(threads_of(arguments->flags));
    const auto progress = make_terminal_progress();
    const runtime::MergeSettings settings{arguments->flags.out, arguments->flags.force, requests, arguments->forget,
                                          loaded.origins};
    return report_result(runtime::run_merge(loaded.configuration, arguments->maps, settings, pool, *progress),
                         arguments->flags.out, arguments->flags.json);
  };
}

}  // namespace mapweave::app
