#include <mapweave/core/exit_code.h>

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

ExitCode exit_code(ErrorCode code) {
  switch (code) {
    case ErrorCode::kUsage: return ExitCode::wrong_usage;
    case ErrorCode::kBadInput:
    case ErrorCode::kMissing:
    case ErrorCode::kCorrupt:
    case ErrorCode::kUnsupported: return ExitCode::bad_input;
    case ErrorCode::kCannotWrite:
    case ErrorCode::kHelperFailed:
    case ErrorCode::kInternal: break;
  }
  return ExitCode::failed;
}

ContractViolation::ContractViolation(const char* expression, const char* file, int line, const std::string& message)
    : std::logic_error(std::string(file) + ":" + std::to_string(line) + ": " + message +
                       " (broken contract: " + expression + ")") {}

}  // namespace mapweave
