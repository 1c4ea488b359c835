// The page over HTTP: what it answers, whom it refuses, and that it ends whatever others do.
#include <mapweave/runtime/page_server.h>

#include <gmock/gmock.h>
#include <mapweave/core/error.h>
#include <mapweave/runtime/live_status.h>
#include <support/fake_mapper.h>
#include <nlohmann/json.hpp>

#include <arpa/inet.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <optional>
#include <thread>

namespace mapweave::runtime {
namespace {

using Json = nlohmann::ordered_json;
using testing::AllOf;
using testing::EndsWith;
using testing::HasSubstr;
using testing::Not;
using testing::StartsWith;
using namespace std::chrono_literals;

constexpr auto kPatience = 60s;  // for a machine that is busy

// A plain connection to the server, so that it can be used badly.
class Visitor {
 public:
  explicit Visitor(const PageServer& page) : socket_(::socket(AF_INET, SOCK_STREAM, 0)) {
    sockaddr_in address{};
    address.sin_family = AF_INET;
    address.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    address.sin_port = htons(static_cast<std::uint16_t>(std::stoi(page.url().substr(page.url().rfind(':') + 1))));
    const timeval patience{std::chrono::seconds(kPatience).count(), 0};
    ::setsockopt(socket_, SOL_SOCKET, SO_RCVTIMEO, &patience, sizeof patience);
    void* plain = &address;
    if (::connect(socket_, static_cast<sockaddr*>(plain), sizeof address) != 0) throw std::runtime_error("no server");
  }
  ~Visitor() { ::close(socket_); }
  Visitor(const Visitor&) = delete;
  Visitor& operator=(const Visitor&) = delete;

  Visitor& say(const std::string& text) {
    ::send(socket_, text.data(), text.size(), MSG_NOSIGNAL);
    return *this;
  }
  Visitor& get(const std::string& path) { return say("GET " + path + " HTTP/1.1\r\nHost: localhost\r\n\r\n"); }
  // All that comes until `end` came, or until the server closes.
  std::string answer(const std::string& end = {}) {
    char buffer[4096];
    while (end.empty() || answer_.find(end) == std::string::npos) {
      const ssize_t count = ::recv(socket_, buffer, sizeof buffer, 0);
      if (count <= 0) break;
      answer_.append(buffer, static_cast<std::size_t>(count));
    }
    return answer_;
  }

 private:
  int socket_;
  std::string answer_;
};

std::string body_of(const std::string& answer) { return answer.substr(answer.find("\r\n\r\n") + 4); }

// A robot that scanned once.
std::shared_ptr<const LivePreview> preview_of_one(std::uint64_t number) {
  auto preview = std::make_shared<LivePreview>();
  preview->number = number;
  LivePreview::JointMap& part = preview->parts.emplace_back();
  part.members = {MapId("alpha")};
  const NodeId id{{{RobotId("alpha"), SensorId("laser")}, 7}, 0};
  part.map.nodes.set(
      id, Node{id, Stamp{1'000'000'000}, Pose3(), std::make_shared<const Payload>(test::make_scan(1.0).scan)});
  return preview;
}

struct PageServerTest : testing::Test {
  PageSource source() {
    PageSource one;
    one.title = "mapweave test";
    one.robots = {"alpha"};
    one.status = [this] {
      if (is_broken) throw std::runtime_error("secret");
      LiveCloudCounts counts;
      counts.trouble = has_trouble ? "disk full" : "";
      const StatusTerms terms{15.0, 1.0};
      return program_status("cloud", "cloud", {tier_status(counts, terms)}, terms);
    };
    one.preview = [this] { return preview_number > 0 ? preview_of_one(preview_number) : nullptr; };
    return one;
  }
  std::string get(const std::string& path) { return Visitor(*page).get(path).answer(); }
  template <class Condition>
  void await(Condition&& condition) {
    const auto end = std::chrono::steady_clock::now() + kPatience;
    while (!condition()) {
      ASSERT_LT(std::chrono::steady_clock::now(), end);
      std::this_thread::sleep_for(20ms);
    }
  }
  std::atomic<bool> has_trouble{false}, is_broken{false};
  std::atomic<std::uint64_t> preview_number{0};
  std::optional<PageServer> page{std::in_place, "127.0.0.1", 0, source()};
};

TEST_F(PageServerTest, shows_page_status_metrics_and_health) {
  EXPECT_THAT(page->url(), AllOf(StartsWith("http://127.0.0.1:"), EndsWith("/")));
  const std::string shown = get("/");
  EXPECT_THAT(shown, AllOf(StartsWith("HTTP/1.1 200"), HasSubstr("text/html"),
                           HasSubstr("<title>mapweave test</title>"), HasSubstr("X-Content-Type-Options: nosniff")));
  EXPECT_EQ(Json::parse(body_of(get("/status.json")))["tiers"][0]["role"], "cloud");
  EXPECT_THAT(get("/metrics"), AllOf(HasSubstr("text/plain; version=0.0.4"), HasSubstr("\nmapweave_healthy 1\n")));
  EXPECT_THAT(get("/healthz"), AllOf(StartsWith("HTTP/1.1 200"), EndsWith("\r\n\r\nok\n")));
  EXPECT_THAT(get("/favicon.ico"), StartsWith("HTTP/1.1 204")) << "browsers ask for it, and complain";
  EXPECT_THAT(Visitor(*page).say("HEAD /metrics HTTP/1.0\r\n\r\n").answer(),
              AllOf(HasSubstr(" 200 "), EndsWith("\r\n\r\n")));
}

TEST_F(PageServerTest, says_why_it_is_not_healthy) {
  has_trouble = true;
  EXPECT_THAT(get("/healthz"), AllOf(StartsWith("HTTP/1.1 503"), EndsWith("cloud cloud: disk full\n")));
  EXPECT_THAT(get("/metrics"), HasSubstr("\nmapweave_healthy 0\n"));
}

TEST_F(PageServerTest, refuses_what_it_has_not_and_what_would_change_something) {
  EXPECT_THAT(get("/etc/passwd"), StartsWith("HTTP/1.1 404"));
  EXPECT_THAT(get("/../status.json"), StartsWith("HTTP/1.1 404"));
  const std::string posted = Visitor(*page)
                                 .say(
                                     "POST / HTTP/1.1\r\nHost: localhost\r\nContent-Length: 44\r\n\r\nGET /healthz "
                                     "HTTP/1.1\r\nHost: localhost\r\n\r\n")
                                 .answer();
  EXPECT_THAT(posted, AllOf(StartsWith("HTTP/1.1 405"), HasSubstr("Allow: GET, HEAD"), Not(HasSubstr("ok\n"))))
      << "what was posted is no request";
  EXPECT_THAT(Visitor(*page).say("GET / HTTP/1.1\r\nHost: evil.example:80\r\n\r\n").answer(),
              StartsWith("HTTP/1.1 421"));
  EXPECT_THAT(Visitor(*page).say("GET /healthz HTTP/1.1\r\nHost: [::1]:80\r\n\r\n").answer(),
              StartsWith("HTTP/1.1 200"));
  is_broken = true;
  std::this_thread::sleep_for(300ms);  // what it said holds for a moment
  EXPECT_THAT(get("/status.json"), AllOf(StartsWith("HTTP/1.1 500"), Not(HasSubstr("secret"))));
}

TEST_F(PageServerTest, gets_over_requests_that_are_long_slow_or_no_requests) {
  Visitor half(*page);
  half.say("GET / HT");
  EXPECT_THAT(Visitor(*page).say("\x01\x02 no HTTP\r\n\r\n").answer(), Not(HasSubstr(" 200 ")));
  EXPECT_THAT(Visitor(*page).say("GET /" + std::string(100'000, 'x') + " HTTP/1.1\r\n\r\n").answer(),
              Not(HasSubstr(" 200 ")));
  std::string headers = "GET / HTTP/1.1\r\n";
  for (int i = 0; i < 20'000; ++i) headers += "X-" + std::to_string(i) + ": y\r\n";
  EXPECT_THAT(Visitor(*page).say(headers + "\r\n").answer(), Not(HasSubstr(" 200 ")));
  for (const char* header : {"Range: bytes=99999999999999999999999-", "Range: bytes=-", "Content-Length: many",
                             "Content-Length: -1", "Expect: 100-continue", "Accept-Encoding: gzip;q=x, br"})
    Visitor(*page).say("GET /healthz HTTP/1.1\r\n" + std::string(header) + "\r\n\r\n").answer();
  std::string ranges = "0-";
  for (int i = 0; i < 1000; ++i) ranges += ",0-";
  EXPECT_LT(
      Visitor(*page).say("GET / HTTP/1.1\r\nHost: localhost\r\nRange: bytes=" + ranges + "\r\n\r\n").answer().size(),
      get("/").size() + 1000);
  EXPECT_THAT(get("/healthz"), StartsWith("HTTP/1.1 200"));
  EXPECT_THAT(half.answer(), Not(HasSubstr(" 200 "))) << "it was given up";
}

TEST_F(PageServerTest, sends_events_while_it_runs_and_one_when_it_ends) {
  Visitor visitor(*page);
  const std::string first = visitor.get("/events").answer("\n\n");
  EXPECT_THAT(first, AllOf(StartsWith("HTTP/1.1 200"), HasSubstr("text/event-stream")));
  const std::string data = first.substr(first.find("data: ") + 6);
  const Json event = Json::parse(data.substr(0, data.find('\n')));
  EXPECT_EQ(event["maps"], 0);
  EXPECT_EQ(event["status"]["program"], "cloud");
  preview_number = 5;
  EXPECT_THAT(visitor.answer("\"maps\":5}"), HasSubstr("\"maps\":5}"));
  const auto begin = std::chrono::steady_clock::now();
  page.reset();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 20s);
  EXPECT_THAT(visitor.answer(), EndsWith("event: end\ndata: {}\n\n"));
}

TEST_F(PageServerTest, lets_only_so_many_look_and_others_when_they_have_gone) {
  std::vector<std::unique_ptr<Visitor>> visitors;
  for (int i = 0; i < PageServer::kMostStreams; ++i) {
    visitors.push_back(std::make_unique<Visitor>(*page));
    EXPECT_THAT(visitors.back()->get("/events").answer("\n\n"), HasSubstr("event: status"));
  }
  EXPECT_THAT(get("/events"), AllOf(StartsWith("HTTP/1.1 503"), HasSubstr("Retry-After: 5")));
  EXPECT_THAT(get("/healthz"), StartsWith("HTTP/1.1 200"));
  visitors.pop_back();
  await([&] { return Visitor(*page).get("/events").answer("\n\n").find("event: status") != std::string::npos; });
}

TEST_F(PageServerTest, ends_although_others_say_half_of_something_and_read_nothing) {
  std::vector<std::unique_ptr<Visitor>> visitors;
  for (int i = 0; i < 36; ++i) {
    visitors.push_back(std::make_unique<Visitor>(*page));
    visitors.back()->say(i % 2 == 0 ? "GET /even" : "GET /events HTTP/1.1\r\nHost: localhost\r\n\r\n");
  }
  const auto begin = std::chrono::steady_clock::now();
  page.reset();
  EXPECT_LT(std::chrono::steady_clock::now() - begin, 20s);
}

TEST_F(PageServerTest, draws_new_maps_but_not_all_the_time) {
  const auto maps = [&] { return Json::parse(body_of(get("/maps.json"))); };
  EXPECT_EQ(maps(), Json::parse(R"({"number": 0, "maps": []})"));
  preview_number = 1;
  const auto begin = std::chrono::steady_clock::now();
  const Json first = maps();
  preview_number = 2;
  const Json second = maps();
  EXPECT_EQ(first["number"], 1);
  ASSERT_EQ(first["maps"].size(), 1u);
  EXPECT_EQ(first["maps"][0]["title"], "alpha");
  EXPECT_EQ(first["maps"][0]["trajectories"].size(), 1u);
  EXPECT_THAT(first["maps"][0]["grid"]["levels"][0]["png"].get<std::string>(), StartsWith("data:image/png;base64,"));
  if (std::chrono::steady_clock::now() - begin < 2s) {
    EXPECT_EQ(second["number"], 1);
  }
  await([&] { return maps()["number"] == 2; });
  EXPECT_GE(std::chrono::steady_clock::now() - begin, 2s);
}

TEST_F(PageServerTest, says_that_a_port_is_taken_and_that_an_address_is_not_here) {
  const int port = std::stoi(page->url().substr(page->url().rfind(':') + 1));
  const auto why = [&](const std::string& host) -> std::string {
    try {
      const PageServer other(host, port, source());
    } catch (const Error& error) {
      EXPECT_EQ(error.code(), ErrorCode::kBadInput);
      return error.what();
    }
    return "it listens";
  };
  EXPECT_THAT(why("127.0.0.1"),
              AllOf(HasSubstr("in use"), HasSubstr("127.0.0.1:" + std::to_string(port)), HasSubstr("live.page_port")));
  EXPECT_THAT(why("203.0.113.7"), HasSubstr("cannot be shown there"));
  page.reset();
  EXPECT_EQ(why("127.0.0.1"), "it listens") << "the port is free again at once";
  EXPECT_TRUE(is_loopback("127.0.0.1") && is_loopback("localhost") && is_loopback("::1"));
  EXPECT_FALSE(is_loopback("0.0.0.0") || is_loopback("192.168.1.7"));
}

}  // namespace
}  // namespace mapweave::runtime
