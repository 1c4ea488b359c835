#include "nats_library.h"

#include <mapweave/core/error.h>
#include <mapweave/core/log.h>
#include <mapweave/core/mixed_bits.h>
#include <mapweave/core/stopwatch.h>
#include <mapweave/transport/nats_connection.h>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <deque>
#include <map>
#include <mutex>
#include <random>
#include <thread>
#include <utility>
#include <vector>

namespace mapweave::transport {
namespace {

using Clock = std::chrono::steady_clock;
using Handler = std::function<void(const NatsMessage&)>;
using ConnectionHandle = std::shared_ptr<natsConnection>;

constexpr double kWatch_s = 2.0;  // between signs of life that are asked for
constexpr int kMostPendingMessages = 1 << 20;
constexpr std::size_t kMostPendingBytes = std::size_t{512} << 20;  // what was asked for is less

std::string random_name() {
  std::random_device device;
  std::string name;
  for (int i = 0; i < 24; ++i) name += "0123456789abcdef"[device() % 16];
  return name;
}

}  // namespace

struct NatsConnection::State : std::enable_shared_from_this<State> {
  explicit State(NatsOptions given)
      : options(std::move(given)), library(library_options(options)), root(options.inbox + "." + random_name()) {
    shown.server = shown_url(options.url);
  }

  // Somebody who receives. Answers to requests and to publications come by one subscription for all; what a consumer
  // delivers has the stream's subject, and comes by one of its own.
  struct Receiver {
    std::string token;
    bool has_own_subscription = false;
    std::atomic<bool> is_gone{false};
    Handler handler;
  };
  struct Arrival {
    std::shared_ptr<Receiver> to;
    NatsMessage message;
  };

  const NatsOptions options;
  const OptionsHandle library;
  const std::string root;
  std::thread thread;

  mutable std::mutex mutex;
  mutable std::condition_variable changed;
  ConnectionHandle connection;  // null: there is none
  NatsState shown;
  natsStatus last_status = NATS_OK;
  std::uint64_t generation = 0, attempt = 0, inboxes_made = 0;
  Clock::time_point connected_at, came_at;
  std::map<std::string, std::shared_ptr<Receiver>> receivers;  // by the token below the root
  std::deque<Arrival> arrived;
  std::size_t arrived_bytes = 0;
  std::deque<std::function<void()>> posted;
  bool ends = false, is_closed = false;

  // Of the current connection.
  std::map<std::string, SubscriptionHandle> subscriptions;
  std::vector<SubscriptionHandle> unsubscribed;
  std::size_t alive_subscriptions = 0;

  void run();
  bool serve(natsConnection* made);
  bool wait(double seconds);
  void work(std::chrono::milliseconds patience);
  void watch(const ConnectionHandle& made, Clock::time_point& watched);
  void let_go(const ConnectionHandle& made);
  natsStatus subscribe(natsConnection* made, const std::string& token);
  void arrive(const std::string& token, natsMsg* message);
  void trouble(natsStatus status, const std::string& words);
  void set(const ConnectionHandle& made);
  ConnectionHandle current() const {
    const std::lock_guard lock(mutex);
    return connection;
  }
};

namespace {

void on_error(natsConnection*, natsSubscription*, natsStatus status, void*) {
  if (status != NATS_OK) log(LogLevel::warning, std::string("NATS: ") + words_of(status));
}

}  // namespace

void NatsConnection::State::trouble(natsStatus status, const std::string& words) {
  bool is_new = false;
  {
    const std::lock_guard lock(mutex);
    is_new = std::exchange(shown.trouble, words) != words;
    last_status = status;
    changed.notify_all();
  }
  if (is_new) log(LogLevel::warning, shown.server + ": " + words);
}

void NatsConnection::State::set(const ConnectionHandle& made) {
  const std::lock_guard lock(mutex);
  connection = made;
  shown.is_connected = made != nullptr;
  ++generation;
  if (made) {
    connected_at = came_at = Clock::now();
    last_status = NATS_OK;
    if (++shown.connects > 1) log(LogLevel::info, shown.server + ": connected again");
  }
  for (const auto& [token, receiver] : receivers) arrived.push_back({receiver, {}});
  changed.notify_all();
}

// On a thread of the library.
void NatsConnection::State::arrive(const std::string& token, natsMsg* from) {
  NatsMessage message = message_of(from);
  std::string name = token;
  if (name.empty()) {  // the subscription for all: "<root>.<token>.<more>"
    if (message.subject.size() <= root.size() + 1) return;
    name = message.subject.substr(root.size() + 1);
    name.resize(std::min(name.size(), name.find('.')));
  }
  const std::lock_guard lock(mutex);
  came_at = Clock::now();
  const auto known = receivers.find(name);
  if (known == receivers.end()) return;
  if (arrived_bytes + message.bytes.size() > kMostPendingBytes) {
    shown.trouble = "more came than was asked for, and was dropped";
    return;
  }
  arrived_bytes += message.bytes.size();
  arrived.push_back({known->second, std::move(message)});
  changed.notify_all();
}

// What has arrived and what was posted, or waits for some.
void NatsConnection::State::work(std::chrono::milliseconds patience) {
  std::deque<Arrival> messages;
  std::deque<std::function<void()>> jobs;
  {
    std::unique_lock lock(mutex);
    changed.wait_for(lock, patience, [&] { return ends || is_closed || !arrived.empty() || !posted.empty(); });
    messages.swap(arrived);
    jobs.swap(posted);
    arrived_bytes = 0;
  }
  for (const Arrival& one : messages)
    if (!one.to->is_gone) one.to->handler(one.message);
  for (const auto& job : jobs) job();
}

// Whether to go on.
bool NatsConnection::State::wait(double seconds) {
  const auto until = in_seconds(seconds);
  for (;;) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(until - Clock::now());
    work(std::max(left, std::chrono::milliseconds(0)));
    const std::lock_guard lock(mutex);
    if (ends || Clock::now() >= until) return !ends;
  }
}

// token: of one with a subscription of its own; empty: the one for all.
natsStatus NatsConnection::State::subscribe(natsConnection* made, const std::string& token) {
  const auto take = [](natsConnection*, natsSubscription*, natsMsg* message, void* number) {
    const MessageHandle owned(message, &natsMsg_Destroy);
    const Callbacks::Target target = Callbacks::all().find(number);
    if (const auto state = std::static_pointer_cast<State>(target.state.lock())) state->arrive(target.token, message);
  };
  const auto complete = [](void* number) {
    const Callbacks::Target target = Callbacks::all().find(number);
    Callbacks::all().remove(number);
    const auto state = std::static_pointer_cast<State>(target.state.lock());
    if (!state) return;
    const std::lock_guard lock(state->mutex);
    --state->alive_subscriptions;
    state->changed.notify_all();
  };
  void* const number = Callbacks::all().add(weak_from_this(), token);
  const std::string subject = token.empty() ? root + ".*.>" : root + "." + token;
  natsSubscription* subscribed = nullptr;
  const natsStatus status = natsConnection_Subscribe(&subscribed, made, subject.c_str(), take, number);
  if (status != NATS_OK) {
    Callbacks::all().remove(number);
    return status;
  }
  natsSubscription_SetPendingLimits(subscribed, kMostPendingMessages, static_cast<int>(kMostPendingBytes));
  const std::lock_guard lock(mutex);
  if (natsSubscription_SetOnCompleteCB(subscribed, complete, number) == NATS_OK) ++alive_subscriptions;
  subscriptions.insert_or_assign(token, SubscriptionHandle(subscribed, &natsSubscription_Destroy));
  return NATS_OK;
}

void NatsConnection::State::watch(const ConnectionHandle& made, Clock::time_point& watched) {
  if (seconds_since(watched) < kWatch_s) return;
  watched = Clock::now();
  natsConnection_Publish(made.get(), (root + ".alive.").append("x").c_str(), nullptr, 0);
  const std::lock_guard lock(mutex);
  if (seconds_since(came_at) < options.silence_s) return;
  shown.trouble = "nothing came from the broker for " + std::to_string(static_cast<int>(options.silence_s)) + " s";
  is_closed = true;
}

// Closed first, so that nothing is delivered any more when subscriptions are destroyed.
void NatsConnection::State::let_go(const ConnectionHandle& made) {
  natsConnection_Close(made.get());
  std::map<std::string, SubscriptionHandle> all;
  std::vector<SubscriptionHandle> others;
  std::unique_lock lock(mutex);
  all.swap(subscriptions);
  others.swap(unsubscribed);
  if (changed.wait_for(lock, std::chrono::seconds(10), [&] { return alive_subscriptions == 0; })) return;
  for (auto& [token, one] : all) static_cast<void>(one.release());  // rather than destroy what is in use
  for (auto& one : others) static_cast<void>(one.release());
  alive_subscriptions = 0;
}

// Hands over what comes until the connection is lost. Whether it lived for long.
bool NatsConnection::State::serve(natsConnection* library_connection) {
  const ConnectionHandle made(library_connection, &natsConnection_Destroy);
  std::vector<std::string> tokens{""};
  {
    const std::lock_guard lock(mutex);
    for (const auto& [token, receiver] : receivers)
      if (receiver->has_own_subscription) tokens.push_back(token);
  }
  natsStatus status = NATS_OK;
  for (const std::string& token : tokens)
    if (status == NATS_OK) status = subscribe(made.get(), token);
  if (status != NATS_OK) {
    trouble(status, words_of(status));
    let_go(made);
    return false;
  }
  set(made);
  for (Clock::time_point watched = Clock::now();;) {
    work(std::chrono::milliseconds(500));
    watch(made, watched);
    const std::lock_guard lock(mutex);
    if (ends || is_closed) break;
  }
  const char* words = nullptr;
  const natsStatus why = natsConnection_GetLastError(made.get(), &words);
  const std::string said = why == NATS_OK || words == nullptr || *words == '\0' ? "the connection was lost" : words;
  const double lived_s = seconds_since(connected_at);
  set(nullptr);
  let_go(made);
  if (std::unique_lock lock(mutex); !ends) {
    lock.unlock();
    trouble(why, said);
  }
  return lived_s > options.most_wait_s;
}

void NatsConnection::State::run() {
  // May come late: a connection of before says nothing of this one.
  const auto closed = [](natsConnection*, void* number) {
    const Callbacks::Target target = Callbacks::all().find(number);
    Callbacks::all().remove(number);
    const auto state = std::static_pointer_cast<State>(target.state.lock());
    if (!state) return;
    const std::lock_guard lock(state->mutex);
    if (target.token != std::to_string(state->attempt)) return;
    state->is_closed = true;
    state->changed.notify_all();
  };
  double wait_s = options.least_wait_s;
  std::uint64_t drawn = std::hash<std::string>()(root);
  for (bool goes_on = true; goes_on;) {
    void* number = nullptr;
    {
      const std::lock_guard lock(mutex);
      number = Callbacks::all().add(weak_from_this(), std::to_string(++attempt));
    }
    natsOptions_SetErrorHandler(library.get(), on_error, nullptr);
    natsOptions_SetClosedCB(library.get(), closed, number);
    natsConnection* made = nullptr;
    const natsStatus status = natsConnection_Connect(&made, library.get());
    if (status == NATS_OK) {
      if (serve(made)) wait_s = options.least_wait_s;
    } else {
      trouble(status, words_of(status));
      Callbacks::all().remove(number);
    }
    {
      const std::lock_guard lock(mutex);
      is_closed = false;
      ++attempt;
    }
    const double jitter = 0.75 + 0.5 * static_cast<double>(mixed(++drawn) >> 11) * 0x1p-53;
    goes_on = wait(wait_s * jitter);
    wait_s = std::min(2.0 * wait_s, std::max(options.least_wait_s, options.most_wait_s));
  }
}

NatsConnection::NatsConnection(NatsOptions options) : state_(std::make_shared<State>(std::move(options))) {
  state_->thread = std::thread([state = state_] { state->run(); });
}

NatsConnection::~NatsConnection() {
  ConnectionHandle connection;
  {
    const std::lock_guard lock(state_->mutex);
    state_->ends = true;
    connection = state_->connection;
    state_->changed.notify_all();
  }
  if (connection) natsConnection_Close(connection.get());
  if (state_->thread.get_id() == std::this_thread::get_id())
    state_->thread.detach();  // it has what it needs, and ends when it returns
  else
    state_->thread.join();
}

NatsState NatsConnection::state() const {
  const std::lock_guard lock(state_->mutex);
  NatsState shown = state_->shown;
  if (shown.is_connected) shown.connected_s = seconds_since(state_->connected_at);
  if (shown.connects > 0) shown.silent_s = seconds_since(state_->came_at);
  return shown;
}

std::uint64_t NatsConnection::generation() const {
  const std::lock_guard lock(state_->mutex);
  return state_->generation;
}

void NatsConnection::wait_until_connected(std::chrono::milliseconds patience) const {
  std::unique_lock lock(state_->mutex);
  if (state_->changed.wait_for(lock, patience, [&] { return state_->shown.is_connected; })) return;
  const std::string words = state_->shown.trouble.empty() ? "no answer" : state_->shown.trouble;
  if (is_refusal(state_->last_status))
    throw Error(ErrorCode::kBadInput, "the broker refuses the connection: " + words, state_->shown.server,
                "check user, password, token and certificates on both sides");
  throw BrokerAway("the broker cannot be reached: " + words, state_->shown.server,
                   "check that nats-server runs there and that its port can be reached");
}

void NatsConnection::expect_jet_stream(std::chrono::milliseconds patience, const std::string& domain) {
  const auto end = std::chrono::steady_clock::now() + patience;
  std::optional<NatsMessage> answer;
  do {  // a connection that is lost at once is made anew
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(end - std::chrono::steady_clock::now());
    wait_until_connected(left);
    answer = request(domain.empty() ? "$JS.API.INFO" : "$JS." + domain + ".API.INFO", "", left);
  } while (!answer && std::chrono::steady_clock::now() < end);
  const std::string server = state().server, of_domain = domain.empty() ? "" : " of domain '" + domain + "'";
  if (!answer) throw BrokerAway("JetStream" + of_domain + " does not answer", server, "see whether the broker runs");
  if (answer->status != 0)
    throw Error(ErrorCode::kUnsupported,
                domain.empty() ? "the broker has no JetStream" : "nobody there has JetStream" + of_domain, server,
                "start nats-server with -js, or with 'jetstream' in its configuration");
  const auto json = nlohmann::json::parse(answer->bytes, nullptr, false);
  if (json.is_object() && json.contains("error"))
    throw Error(ErrorCode::kUnsupported,
                "the broker's JetStream" + of_domain + " is not for this account: " + json["error"].dump(), server,
                "enable JetStream for the account in the broker's configuration");
}

namespace {

struct Inbox : NatsInbox {
  std::function<void()> end;
  std::string name;
  ~Inbox() override { end(); }
  const std::string& subject() const override { return name; }
};

}  // namespace

std::unique_ptr<NatsInbox> NatsConnection::open_inbox(Handler handler, InboxKind kind) {
  auto inbox = std::make_unique<Inbox>();
  auto receiver = std::make_shared<State::Receiver>();
  receiver->handler = std::move(handler);
  receiver->has_own_subscription = kind == InboxKind::deliveries;
  ConnectionHandle connection;
  {
    const std::lock_guard lock(state_->mutex);
    receiver->token = std::to_string(++state_->inboxes_made);
    state_->receivers.emplace(receiver->token, receiver);
    connection = state_->connection;
  }
  // A connection that is made meanwhile subscribes it as well: then it is subscribed twice, and what comes twice is
  // harmless.
  if (connection && receiver->has_own_subscription) state_->subscribe(connection.get(), receiver->token);
  inbox->name = state_->root + "." + receiver->token + (receiver->has_own_subscription ? "" : ".a");
  inbox->end = [weak = std::weak_ptr(state_), receiver, token = receiver->token] {
    receiver->is_gone = true;
    const auto state = weak.lock();
    if (!state) return;
    SubscriptionHandle own(nullptr, &natsSubscription_Destroy);
    {
      const std::lock_guard lock(state->mutex);
      state->receivers.erase(token);
      const auto known = state->subscriptions.find(token);
      if (known == state->subscriptions.end()) return;
      own = std::move(known->second);
      state->subscriptions.erase(known);
    }
    natsSubscription_Unsubscribe(own.get());
    const std::lock_guard lock(state->mutex);
    state->unsubscribed.push_back(std::move(own));  // destroyed with the connection, when nothing is in flight
  };
  return inbox;
}

void NatsConnection::post(std::function<void()> work) {
  const std::lock_guard lock(state_->mutex);
  state_->posted.push_back(std::move(work));
  state_->changed.notify_all();
}

bool NatsConnection::publish(const std::string& subject, std::string_view bytes, const std::string& reply,
                             const std::string& message_id) {
  const ConnectionHandle connection = state_->current();
  if (!connection) return false;
  natsMsg* made = nullptr;
  if (natsMsg_Create(&made, subject.c_str(), reply.empty() ? nullptr : reply.c_str(), bytes.data(),
                     static_cast<int>(bytes.size())) != NATS_OK)
    return false;
  const MessageHandle message(made, &natsMsg_Destroy);
  if (!message_id.empty() && natsMsgHeader_Set(made, "Nats-Msg-Id", message_id.c_str()) != NATS_OK) return false;
  return natsConnection_PublishMsg(connection.get(), made) == NATS_OK;
}

std::optional<NatsMessage> NatsConnection::request(const std::string& subject, std::string_view bytes,
                                                   std::chrono::milliseconds patience, const std::string& message_id) {
  MAPWEAVE_EXPECT(!is_own_thread(), "the connection's thread must not wait");
  struct Answer {
    std::mutex mutex;
    std::condition_variable came;
    std::optional<NatsMessage> message;
    bool is_lost = false;
  };
  const auto answer = std::make_shared<Answer>();
  const auto inbox = open_inbox(
      [answer](const NatsMessage& message) {
        const std::lock_guard lock(answer->mutex);
        if (message.subject.empty())
          answer->is_lost = true;
        else if (!answer->message)
          answer->message = message;
        answer->came.notify_all();
      },
      InboxKind::answers);
  if (!publish(subject, bytes, inbox->subject(), message_id)) return std::nullopt;
  std::unique_lock lock(answer->mutex);
  answer->came.wait_for(lock, patience, [&] { return answer->message || answer->is_lost; });
  return answer->message;
}

bool NatsConnection::is_own_thread() const { return std::this_thread::get_id() == state_->thread.get_id(); }

void NatsConnection::cut() {
  if (const ConnectionHandle connection = state_->current()) natsConnection_Close(connection.get());
}

}  // namespace mapweave::transport
