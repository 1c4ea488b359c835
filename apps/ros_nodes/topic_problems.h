#pragma once
// What publishers of maps share.

#include <mapweave/core/error.h>
#include <mapweave/core/log.h>

#include <map>
#include <optional>
#include <string>
#include <utility>

namespace mapweave::ros_nodes {

// What keeps a message from being made: logged once, until another problem comes. Not thread-safe.
class Problems {
 public:
  template <class Make>
  auto guarded(const std::string& what, Make&& make) -> std::optional<decltype(make())> {
    try {
      return make();
    } catch (const Error& error) {
      say(what, error.what());
      return std::nullopt;
    }
  }
  void say(const std::string& what, const std::string& why) {
    if (std::exchange(said_[what], why) != why) log(LogLevel::warning, what + ": " + why);
  }

 private:
  std::map<std::string, std::string> said_;
};

}  // namespace mapweave::ros_nodes
