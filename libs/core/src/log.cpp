#include "console.h"

#include <mapweave/core/error.h>
#include <mapweave/core/journal.h>
#include <mapweave/core/log.h>
#include <spdlog/logger.h>
#include <spdlog/sinks/base_sink.h>

#include <memory>

namespace mapweave {
namespace {

LogLevel level_of(const spdlog::details::log_msg& message) {
  if (message.level >= spdlog::level::err) return LogLevel::error;
  if (message.level == spdlog::level::warn) return LogLevel::warning;
  return message.level == spdlog::level::info ? LogLevel::info : LogLevel::debug;
}

class ConsoleSink final : public spdlog::sinks::base_sink<std::mutex> {
  void sink_it_(const spdlog::details::log_msg& message) override {
    if (logs_to_journal()) {
      console::write_line(journal_prefix(level_of(message)) +
                          std::string(message.payload.data(), message.payload.size()));
      return;
    }
    spdlog::memory_buf_t line;
    formatter_->format(message, line);
    std::string_view text(line.data(), line.size());
    if (!text.empty() && text.back() == '\n') text.remove_suffix(1);
    console::write_line(text);
  }
  void flush_() override {}
};

spdlog::logger& logger() {
  // Never destroyed: destructors of static objects may still log.
  static spdlog::logger& instance = *[] {
    auto* made = new spdlog::logger("mapweave", std::make_shared<ConsoleSink>());
    made->set_pattern("%Y-%m-%d %H:%M:%S %l: %v");
    return made;
  }();
  return instance;
}

spdlog::level::level_enum spdlog_level(LogLevel level) {
  switch (level) {
    case LogLevel::debug: return spdlog::level::debug;
    case LogLevel::info: return spdlog::level::info;
    case LogLevel::warning: return spdlog::level::warn;
    case LogLevel::error: break;
  }
  return spdlog::level::err;
}

}  // namespace

void log(LogLevel level, std::string_view message) {
  logger().log(spdlog_level(level), spdlog::string_view_t(message.data(), message.size()));
}

void set_log_level(LogLevel lowest) { logger().set_level(spdlog_level(lowest)); }

bool console::shows_progress() { return logger().should_log(spdlog::level::info); }

LogLevel log_level_from_text(std::string_view text) {
  if (text == "debug") return LogLevel::debug;
  if (text == "info") return LogLevel::info;
  if (text == "warning") return LogLevel::warning;
  if (text == "error") return LogLevel::error;
  throw Error(ErrorCode::kUsage, "unknown log level '" + std::string(text) + "'", {},
              "use debug, info, warning or error");
}

}  // namespace mapweave
