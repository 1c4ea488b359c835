#include <mapweave/core/exit_code.h>

#include <algorithm>
#include <string_view>
#include <utility>

namespace mapweave {
namespace {

std::string message_of(const std::string& what, const std::string& where, const std::string& remedy) {
  std::string message = where.empty() ? what : where + ": " + what;
  if (!remedy.empty()) message += "; " + remedy;
  return message;
}

// Results are built beside their goal, as NAME.partial-NUMBER (files.h): the reader knows the goal alone.
std::string place_of(ErrorCode code, std::string path) {
  if (code != ErrorCode::kCannotWrite) return path;
  constexpr std::string_view kPartial = ".partial-";
  for (std::size_t from = path.find(kPartial); from != std::string::npos; from = path.find(kPartial, from)) {
    const std::size_t end = std::min(path.find_first_not_of("0123456789-", from + kPartial.size()), path.size());
    if (end == from + kPartial.size())
      from = end;
    else
      path.erase(from, end - from);
  }
  return path;
}

}  // namespace

Error::Error(ErrorCode code, std::string what, std::string where, std::string remedy)
    : std::runtime_error(message_of(what, place_of(code, where), remedy)),
      code_(code),
      problem_(std::move(what)),
      where_(place_of(code, where)),
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
