#include <mapweave/runtime/page_server.h>

#include "http_connections.h"

#include <mapweave/core/error.h>
#include <mapweave/core/log.h>
#include <mapweave/report/live_page.h>
#include <mapweave/runtime/json_text.h>
#include <mapweave/runtime/live_status.h>

#include <csignal>
#include <cstring>
#include <optional>
#include <thread>

namespace mapweave::runtime {
namespace {

using namespace std::chrono_literals;
using Clock = std::chrono::steady_clock;
using Json = nlohmann::ordered_json;

constexpr auto kBetweenEvents = 1s, kBetweenMaps = 2s, kToSayEnd = 2s;
constexpr auto kStatusHolds = 200ms;
constexpr int kMapsCost = 4;       // drawing takes at most one part of so many of a processor
constexpr int kBesideStreams = 4;  // threads
constexpr char kText[] = "text/plain; charset=utf-8", kJson[] = "application/json";

// The library ignores the signal for the whole process, helpers that it starts too; we send without it.
class KeptPipeSignal {
 public:
  KeptPipeSignal() { ::sigaction(SIGPIPE, nullptr, &before_); }
  ~KeptPipeSignal() { ::sigaction(SIGPIPE, &before_, nullptr); }
  KeptPipeSignal(const KeptPipeSignal&) = delete;
  KeptPipeSignal& operator=(const KeptPipeSignal&) = delete;

 private:
  struct sigaction before_ {};
};

std::string event(const char* name, const Json& data) {
  return "event: " + std::string(name) + "\ndata: " + json_text(data, -1) + "\n\n";
}

std::string without_port(std::string host) {
  if (!host.empty() && host.front() == '[') return host.substr(1, host.find(']') - 1);
  return host.substr(0, host.find(':'));
}

}  // namespace

bool is_loopback(const std::string& host) {
  return host == "localhost" || host == "::1" || host.compare(0, 4, "127.") == 0;
}

struct PageServer::State {
  const PageSource source;
  const bool is_private;
  std::string url;
  std::unique_ptr<BoundedServer> server;
  std::thread listener;

  std::mutex mutex;
  std::condition_variable changed;
  int streams = 0;

  std::mutex status_mutex;
  Json last_status;
  std::optional<Clock::time_point> status_at;

  std::mutex maps_mutex;
  bool is_drawing = false;
  std::uint64_t drawn_number = 0;
  Clock::time_point draws_again{};
  std::shared_ptr<const std::string> drawn = std::make_shared<std::string>(R"({"number": 0, "maps": []})");

  State(const std::string& host, int port, PageSource of);
  ~State();
  Json status();
  // Under maps_mutex: what would be drawn now; null: what is drawn is new enough.
  std::shared_ptr<const LivePreview> due() const;
  std::uint64_t maps_number();
  std::shared_ptr<const std::string> maps();

  void route(const httplib::Request& request, httplib::Response& response);
  void show(const std::string& path, httplib::Response& response);
  void begin_stream(const httplib::Request& request, httplib::Response& response);
  bool next_event(std::size_t offset, httplib::DataSink& sink);
};

PageServer::State::State(const std::string& host, int port, PageSource of)
    : source(std::move(of)), is_private(is_loopback(host)) {
  {
    const KeptPipeSignal kept;
    server = std::make_unique<BoundedServer>(kMostStreams + kBesideStreams);
  }
  server->set_default_headers({{"X-Content-Type-Options", "nosniff"}, {"Cache-Control", "no-store"}});
  server->set_pre_routing_handler([this](const httplib::Request& request, httplib::Response& response) {
    route(request, response);
    return httplib::Server::HandlerResponse::Handled;
  });
  server->set_exception_handler([](const httplib::Request&, httplib::Response& response, std::exception_ptr) {
    response.status = 500;
    response.set_content("this cannot be shown now; the program's messages may say why\n", kText);
  });
  const int bound = server->open(host, port);
  if (bound < 0) {
    const std::string why = errno != 0 ? std::strerror(errno) : "no such address";
    throw Error(ErrorCode::kBadInput, "the page cannot be shown there: " + why, host + ":" + std::to_string(port),
                "set another live.page_port, or live.page_host to an address of this machine; live.page_port: 0 shows "
                "no page");
  }
  url = "http://" + (host.find(':') == std::string::npos ? host : "[" + host + "]") + ":" + std::to_string(bound) + "/";
  listener = std::thread([this] { server->listen_after_bind(); });
  while (!server->is_running()) std::this_thread::sleep_for(1ms);
}

PageServer::State::~State() {
  {
    std::unique_lock lock(mutex);
    server->end();
    changed.notify_all();
    changed.wait_for(lock, kToSayEnd, [&] { return streams == 0; });
  }
  server->stop();
  listener.join();
}

Json PageServer::State::status() {
  const std::lock_guard lock(status_mutex);
  const auto now = Clock::now();
  if (!status_at || now - *status_at >= kStatusHolds || server->ends()) {
    last_status = source.status();
    status_at = now;
  }
  return last_status;
}

std::shared_ptr<const LivePreview> PageServer::State::due() const {
  if (is_drawing || Clock::now() < draws_again) return nullptr;
  std::shared_ptr<const LivePreview> preview = source.preview();
  return preview && preview->number != drawn_number ? preview : nullptr;
}

std::uint64_t PageServer::State::maps_number() {
  const std::lock_guard lock(maps_mutex);
  const auto preview = due();
  return preview ? preview->number : drawn_number;
}

// One draws; who asks meanwhile gets what was drawn before.
std::shared_ptr<const std::string> PageServer::State::maps() {
  std::unique_lock lock(maps_mutex);
  const auto preview = due();
  if (!preview) return drawn;
  is_drawing = true;
  lock.unlock();
  const auto began = Clock::now();
  std::shared_ptr<const std::string> text;
  try {
    text = std::make_shared<std::string>(json_text(preview_json(*preview, source.robots, source.compose), -1));
  } catch (const std::exception& error) {
    log(LogLevel::warning, "the page lacks a map: " + std::string(error.what()));
  }
  const auto now = Clock::now();
  lock.lock();
  is_drawing = false;
  draws_again = now + std::max<Clock::duration>(kBetweenMaps, kMapsCost * (now - began));
  drawn_number = preview->number;
  if (text) drawn = std::move(text);
  return drawn;
}

void PageServer::State::route(const httplib::Request& request, httplib::Response& response) {
  response.status = 200;
  const auto refuse = [&](int status, const std::string& why) {
    response.status = status;
    response.set_content(why + "\n", kText);
  };
  const std::string host = without_port(request.get_header_value("Host"));
  if (is_private && !host.empty() && !is_loopback(host))  // a page of the web that made its name one of ours
    return refuse(421, "this page is of this machine alone: ask for " + url);
  if (request.method != "GET" && request.method != "HEAD") {
    response.set_header("Allow", "GET, HEAD");
    return refuse(405, "this page can be looked at, and nothing else");
  }
  if (request.path == "/events") return begin_stream(request, response);
  show(request.path, response);
  if (response.status == 404) refuse(404, "there is nothing here; there is /, /status.json, /metrics and /healthz");
}

void PageServer::State::show(const std::string& path, httplib::Response& response) {
  if (path == "/") {
    response.set_content(report::live_page(source.title, source.robots, status()), "text/html; charset=utf-8");
  } else if (path == "/status.json") {
    response.set_content(json_text(status()) + "\n", kJson);
  } else if (path == "/metrics") {
    response.set_content(metrics_text(status()), "text/plain; version=0.0.4; charset=utf-8");
  } else if (path == "/maps.json") {
    response.set_content(*maps(), kJson);
  } else if (path == "/healthz") {
    const Json now = status();
    std::string problems;
    for (const Json& problem : now["problems"]) problems += problem.get<std::string>() + "\n";
    response.status = now["is_healthy"] ? 200 : 503;
    response.set_content(now["is_healthy"] ? "ok\n" : problems, kText);
  } else if (path == "/favicon.ico") {
    response.status = 204;
  } else {
    response.status = 404;
  }
}

void PageServer::State::begin_stream(const httplib::Request& request, httplib::Response& response) {
  constexpr char kEvents[] = "text/event-stream";
  if (request.method == "HEAD") return response.set_header("Content-Type", kEvents);
  {
    const std::lock_guard lock(mutex);
    if (streams >= kMostStreams) {
      response.status = 503;
      response.set_header("Retry-After", "5");
      return response.set_content("too many look at this page already\n", kText);
    }
    ++streams;
  }
  response.set_content_provider(
      kEvents, [this](std::size_t offset, httplib::DataSink& sink) { return next_event(offset, sink); },
      [this](bool) {
        const std::lock_guard lock(mutex);
        --streams;
        changed.notify_all();
      });
}

bool PageServer::State::next_event(std::size_t offset, httplib::DataSink& sink) {
  if (offset > 0) {
    std::unique_lock lock(mutex);
    changed.wait_for(lock, kBetweenEvents, [&] { return server->ends(); });
  }
  try {
    const bool ends = server->ends();
    Json news = {{"status", status()}};
    if (!ends) news["maps"] = maps_number();
    std::string text = event("status", news);
    if (ends) text += event("end", Json::object());
    if (!sink.write(text.data(), text.size())) return false;
    if (ends) sink.done();
    return true;
  } catch (const std::exception& error) {
    log(LogLevel::warning, "the page's events end: " + std::string(error.what()));
    return false;
  }
}

PageServer::PageServer(const std::string& host, int port, PageSource source)
    : state_(new State(host, port, std::move(source))) {}
PageServer::~PageServer() = default;
const std::string& PageServer::url() const { return state_->url; }

}  // namespace mapweave::runtime
