#pragma once
// The last word of each of several programs, for who asks later: what a program said last is there although it has
// ended.

#include <chrono>
#include <optional>
#include <string>
#include <string_view>

namespace mapweave::transport {

// All calls are thread-safe. Names: any text. Of each name the last word alone is kept, of at most 256 KiB.
class Board {
 public:
  virtual ~Board() = default;
  // Makes it where it is missing. Throws Error: kMissing where who keeps it does not answer, kBadInput where it
  // refuses.
  virtual void ensure(std::chrono::milliseconds patience) = 0;
  // Soon. False: there is no connection, or the word is too long. Where the board is missing it is lost.
  virtual bool put(const std::string& name, std::string_view word) = 0;
  struct Word {
    std::string bytes;
    std::chrono::system_clock::time_point stored;  // by the clock of who keeps it
  };
  // nullopt: it never said anything. Throws Error as ensure, and kCorrupt for an answer that is none.
  virtual std::optional<Word> last(const std::string& name, std::chrono::milliseconds patience) const = 0;
};

}  // namespace mapweave::transport
