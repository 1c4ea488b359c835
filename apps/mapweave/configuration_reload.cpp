#include "configuration_reload.h"

#include <mapweave/core/error.h>
#include <mapweave/core/log.h>

namespace mapweave::app {
namespace {

std::string list(const std::vector<std::string>& keys) {
  std::string text;
  for (const std::string& key : keys) text += (text.empty() ? "" : ", ") + key;
  return text;
}

}  // namespace

std::optional<runtime::LiveOptions> ConfigurationReload::look() {
  if (!signals_.asks_for_reload()) return std::nullopt;
  try {
    const runtime::RunConfiguration news = load_deployment(arguments_.file, arguments_.flags).loaded.configuration;
    runtime::RunConfiguration taken = now_;
    taken.live.take_while_running(news.live);
    const std::vector<std::string> changed = changed_keys(now_, taken), left = changed_keys(taken, news);
    log(LogLevel::info, arguments_.file.string() + " was read again; " +
                            (changed.empty() ? "nothing changes" : "changed: " + list(changed)));
    if (!left.empty()) log(LogLevel::warning, "these options change when the program is started again: " + list(left));
    now_ = std::move(taken);
    return now_.live;
  } catch (const Error& error) {
    log(LogLevel::error,
        "the configuration was not read again, and everything stays as it was: " + std::string(error.what()));
    return std::nullopt;
  }
}

}  // namespace mapweave::app
