#pragma once
// Three kinds of failure, three forms: no answer (std::optional, or a result with a reason), the world let us down
// (Error), the caller broke the contract (MAPWEAVE_EXPECT). Caught once per program and once per worker loop. Being
// interrupted is none of them (interrupt.h).

#include <stdexcept>
#include <string>

namespace mapweave {

enum class ErrorCode {
  kUsage,         // wrong command line
  kBadInput,      // input or configuration that cannot be used
  kMissing,       // a file, key or sensor that should be there is not
  kCorrupt,       // bytes that cannot be decoded
  kUnsupported,   // a newer schema, an unknown class
  kCannotWrite,   // output folder, disk full
  kHelperFailed,  // a child process ended early
  kInternal,      // ours
};

class Error : public std::runtime_error {
 public:
  // what: what is wrong, with what was expected. where: file with line or byte, key, peer; may be empty.
  // remedy: what the reader can do; may be empty. The message is "where: what; remedy".
  Error(ErrorCode code, std::string what, std::string where = {}, std::string remedy = {});
  ErrorCode code() const { return code_; }
  const std::string& problem() const { return problem_; }
  const std::string& where() const { return where_; }
  const std::string& remedy() const { return remedy_; }

 private:
  ErrorCode code_;
  std::string problem_, where_, remedy_;
};

// The caller broke the contract. Throws in every build type.
class ContractViolation : public std::logic_error {
 public:
  ContractViolation(const char* expression, const char* file, int line, const std::string& message);
};
#define MAPWEAVE_EXPECT(condition, message)                                                         \
  do {                                                                                              \
    if (!(condition)) throw ::mapweave::ContractViolation(#condition, __FILE__, __LINE__, message); \
  } while (false)

}  // namespace mapweave
