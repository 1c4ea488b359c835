#include "serve.h"

#include <mapweave/core/error.h>
#include <mapweave/core/log.h>
#include <mapweave/core/stopwatch.h>

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

LivePage::LivePage(runtime::PageSource source, const runtime::LiveOptions& live, Progress& progress)
    : source_(std::move(source)), progress_(progress), host_(live.page_host), port_(live.page_port) {
  show();
}

void LivePage::show() {
  if (port_ != 0) page_ = show_page(host_, port_, source_, progress_);
}

void LivePage::use(const runtime::LiveOptions& live) {
  if (live.page_host == host_ && live.page_port == port_) return;
  host_ = live.page_host;
  port_ = live.page_port;
  page_.reset();
  try {
    show();
  } catch (const Error& error) {
    log(LogLevel::error, "no page is shown: " + std::string(error.what()));
  }
}

void StatusPublisher::publish(bool at_once) {
  using namespace std::chrono_literals;
  constexpr auto kEvery = 2s;
  constexpr int kMakesAgain = 30;  // where somebody deleted the stream
  const auto now = std::chrono::steady_clock::now();
  if (now < next_ && !at_once) return;
  next_ = now + kEvery;
  try {
    if (makes_ && times_++ % kMakesAgain == 0) board_->ensure(kEvery);
    nlohmann::ordered_json status = status_();
    status["said_at_ns"] = now_ns();
    board_->put(user_, status.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace));
  } catch (const Error& error) {
    log(LogLevel::debug, "the broker keeps no status: " + std::string(error.what()));
  }
}

}  // namespace mapweave::app
