#include <mapweave/core/error.h>

#include <utility>

namespace mapweave {
namespace {

std::string message_of(const std::string& what, const std::string& where, const std::string& remedy) {
  std::string message = where.empty() ? what : where + ": " + what;
  if (!remedy.empty()) message += "; " + remedy;
  return message;
}

}  // namespace

Error::Error(ErrorCode code, std::string what, std::string where, std::string remedy)
    : std::runtime_error(message_of(what, where, remedy)),
      code_(code),
      problem_(std::move(what)),
      where_(std::move(where)),
      remedy_(std::move(remedy)) {}

int exit_code(ErrorCode code) {
  switch (code) {
    case ErrorCode::kUsage: return 2;
    case ErrorCode::kBadInput:
    case ErrorCode::kMissing:
    case ErrorCode::kCorrupt:
    case ErrorCode::kUnsupported: return 3;
    case ErrorCode::kInterrupted: return 130;
    case ErrorCode::kCannotWrite:
    case ErrorCode::kHelperFailed:
    case ErrorCode::kInternal: break;
  }
  return 1;
}

ContractViolation::ContractViolation(const char* expression, const char* file, int line, const std::string& message)
    : std::logic_error(std::string(file) + ":" + std::to_string(line) + ": " + message + " (broken contract: " + expression + ")") {}

}  // namespace mapweave
