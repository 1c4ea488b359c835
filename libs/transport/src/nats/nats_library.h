#pragma once
// The C client library (libnats 3.4) with our errors and lifetimes. Nothing else includes its header.

#include <mapweave/transport/nats_connection.h>

#include <nats/nats.h>

#include <map>
#include <mutex>

namespace mapweave::transport {

using OptionsHandle = std::unique_ptr<natsOptions, decltype(&natsOptions_Destroy)>;
using MessageHandle = std::unique_ptr<natsMsg, decltype(&natsMsg_Destroy)>;
using SubscriptionHandle = std::unique_ptr<natsSubscription, decltype(&natsSubscription_Destroy)>;

std::string shown_url(const std::string& url);  // without user and password
std::string words_of(natsStatus status);        // of what the library refused on this thread last
// Whether the broker's answer was no, rather than that there was none.
bool is_refusal(natsStatus status);
// Throws Error(kBadInput) for options that can never work.
OptionsHandle library_options(const NatsOptions& options);
NatsMessage message_of(natsMsg* from);

// What the library's callbacks get: a number, by which they find who is still there. Never freed before a callback.
class Callbacks {
 public:
  using State = std::weak_ptr<void>;
  struct Target {
    State state;
    std::string token;
  };
  static Callbacks& all();
  void* add(State state, std::string token) {
    const std::lock_guard lock(mutex_);
    targets_.emplace(++last_, Target{std::move(state), std::move(token)});
    return reinterpret_cast<void*>(last_);
  }
  Target find(void* number) {
    const std::lock_guard lock(mutex_);
    const auto known = targets_.find(reinterpret_cast<std::uintptr_t>(number));
    return known == targets_.end() ? Target{} : known->second;
  }
  void remove(void* number) {
    const std::lock_guard lock(mutex_);
    targets_.erase(reinterpret_cast<std::uintptr_t>(number));
  }

 private:
  std::mutex mutex_;
  std::uintptr_t last_ = 0;
  std::map<std::uintptr_t, Target> targets_;
};

}  // namespace mapweave::transport
