#include "serve.h"

#include <mapweave/core/log.h>

namespace mapweave::app {

runtime::PageSource page_of(const std::string& title, const runtime::RunConfiguration& configuration,
                            const runtime::RunPlan& plan) {
  runtime::PageSource source;
  source.title = title;
  source.compose = configuration.compose;
  for (const runtime::PlannedRobot& robot : plan.robots) source.robots.push_back(robot.id.str());
  return source;
}

std::unique_ptr<runtime::PageServer> show_page(const std::string& host, int port, runtime::PageSource source,
                                               Progress& progress) {
  auto page = std::make_unique<runtime::PageServer>(host, port, std::move(source));
  progress.say("see " + page->url());
  if (!runtime::is_loopback(host))
    log(LogLevel::warning, "the page is open to all who reach " + page->url() +
                               ": they see maps, names and messages, and no password is asked for; live.page_host: "
                               "127.0.0.1 keeps it to this machine");
  return page;
}

}  // namespace mapweave::app
