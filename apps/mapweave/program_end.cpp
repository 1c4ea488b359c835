#include "program_end.h"

#include <mapweave/core/error.h>
#include <mapweave/core/interrupt.h>
#include <mapweave/core/journal.h>
#include <mapweave/runtime/memory.h>
#include <mapweave/transport/nats_connection.h>

#include <cstdio>
#include <filesystem>
#include <iostream>
#include <new>
#include <string>

namespace mapweave::app {

int exit_code_of(const char* program, const std::function<ExitCode()>& run) {
  const auto complain = [&](const std::string& what, LogLevel level = LogLevel::error) {
    std::fprintf(stderr, "%s%s: %s\n", journal_prefix(level).c_str(), program, what.c_str());
  };
  ExitCode code = ExitCode::failed;
  runtime::limit_kept_memory();
  try {
    const ExitCode ended = run();
    std::cout.flush();
    if (!std::cout) throw Error(ErrorCode::kCannotWrite, "cannot write results", "standard output");
    code = ended;
  } catch (const Interrupted& interrupted) {
    complain(interrupted.message(), LogLevel::info);
    code = ExitCode::interrupted;
  } catch (const transport::BrokerAway& away) {
    complain(away.what());
    code = ExitCode::unanswered;
  } catch (const Error& error) {
    complain(error.what());
    code = exit_code(error.code());
  } catch (const std::filesystem::filesystem_error& error) {
    complain(error.path1().string() + ": " + error.code().message() + "; check the path");
    code = ExitCode::bad_input;
  } catch (const std::bad_alloc&) {
    std::fprintf(stderr, "%s: out of memory\n", program);  // takes none
  } catch (const std::exception& error) {
    complain(std::string("internal error: ") + error.what());
  } catch (...) {
    complain("internal error");
  }
  return static_cast<int>(code);
}

}  // namespace mapweave::app
