#pragma once
// Shows over HTTP what a program of a deployment does: a page that is live, metrics, health, status. Read-only.

#include <mapweave/runtime/live_preview.h>

#include <nlohmann/json_fwd.hpp>

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace mapweave::runtime {

// What is shown. Both are called on threads of the server, and must work until it has ended.
struct PageSource {
  std::string title;
  std::vector<std::string> robots;  // names of all robots of the team
  fusion::ComposeOptions compose;
  std::function<nlohmann::ordered_json()> status;               // program_status()
  std::function<std::shared_ptr<const LivePreview>()> preview;  // null: no preview yet
};

// GET and HEAD of /, /events (server-sent; at most kMostStreams at once, others get 503), /maps.json, /metrics,
// /healthz (200 "ok", or 503 and why), /status.json; 404 and 405 for all else. What `status` throws becomes a 500.
// Requests of more than 8 kB, slower than a few seconds, or for another host's name at a loopback address are refused.
class PageServer {
 public:
  static constexpr int kMostStreams = 16;

  // Listens at once. port 0: any that is free. Throws Error(kBadInput) where it cannot listen there.
  PageServer(const std::string& host, int port, PageSource source);
  // Ends all streams, with an event that says so, and all requests, whoever is slow.
  ~PageServer();
  PageServer(const PageServer&) = delete;
  PageServer& operator=(const PageServer&) = delete;

  const std::string& url() const;  // "http://127.0.0.1:8080/"

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// Whether nobody but this machine reaches it: 127.x.x.x, ::1, localhost.
bool is_loopback(const std::string& host);

}  // namespace mapweave::runtime
