#include "own_broker.h"

#include <mapweave/runtime/nats_wires.h>
#include <mapweave/transport/nats_connection.h>

#include <algorithm>
#include <system_error>

namespace mapweave::app {
namespace {

using namespace std::chrono_literals;

constexpr auto kToAnswer = 1s;  // on this machine

bool is_named(const runtime::RunConfiguration& configuration) {
  return !configuration.live.broker.empty() || !configuration.live.keys.empty() ||
         std::any_of(configuration.edges.begin(), configuration.edges.end(),
                     [](const runtime::EdgeEntry& edge) { return !edge.broker.empty(); });
}

bool answers(const std::string& url) {
  transport::NatsOptions options;
  options.url = url;
  try {
    transport::NatsConnection(options).wait_until_connected(kToAnswer);
  } catch (const transport::BrokerAway&) {
    return false;
  } catch (const Error&) {  // it wants a user
  }
  return true;
}

bool is_installed() {
  try {
    transport::find_broker();
  } catch (const Error&) {
    return false;
  }
  return true;
}

}  // namespace

OwnBroker::OwnBroker(const runtime::RunConfiguration& configuration, const runtime::RunPlan& plan, Progress& progress) {
  if (is_named(configuration) || answers(configuration.live.broker_url()) || !is_installed()) return;
  folder_ = std::filesystem::path(configuration.live.store) / "broker";
  transport::BrokerOptions options;
  options.folder = folder_;
  options.port = runtime::LiveOptions::kBrokerPort;
  options.most_store_bytes = std::max(options.most_store_bytes, runtime::store_bytes(configuration, plan));
  broker_.emplace(std::move(options));
  progress.say("the configuration names no broker: one of this program's own listens at " + broker_->url() +
               ", for programs of this machine");
}

OwnBroker::~OwnBroker() {
  if (!broker_) return;
  broker_->stop();
  if (!is_done_) return;
  std::error_code ignored;
  std::filesystem::remove_all(folder_, ignored);
  std::filesystem::remove(folder_.parent_path(), ignored);  // where nothing else is left
}

}  // namespace mapweave::app
