#include "say_once.h"

#include <mapweave/core/log.h>

#include <mutex>
#include <set>

namespace mapweave::rawlog {

void say_once(const std::string& text) {
  static std::mutex mutex;
  static std::set<std::string> said;
  const std::lock_guard lock(mutex);
  if (said.insert(text).second) log(LogLevel::warning, text);
}

}  // namespace mapweave::rawlog
