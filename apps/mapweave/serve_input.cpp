// mapweave serve robot --stdin: a robot whose log comes through standard input.

#include "serve.h"

#include <mapweave/core/error.h>
#include <mapweave/rawlog/growing_log.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <optional>
#include <system_error>
#include <thread>
#include <vector>

namespace mapweave::app {
namespace {

constexpr int kPatience_ms = 50;
constexpr std::size_t kBlockBytes = std::size_t{1} << 16;
constexpr std::uint64_t kEnoughBytes = 4096;  // to know a log's format by

class InputAsLog final : public RoleExtension {
 public:
  using RoleExtension::look;
  ~InputAsLog() override { stop(); }

  void begin(const Deployment& deployment, const std::string& name, StopSignals&) override {
    for (const runtime::PlannedRobot& robot : deployment.plan.robots)
      if (robot.id.str() == name) log_.emplace(robot.log, rawlog::GrowingLog::Begin::new_file);
    copier_ = std::thread([this] { copy(); });
  }

  bool look(const StartingRobot&, const Status&) override {
    if (is_ended_ && trouble_) throw Error(*trouble_);
    return is_ended_;
  }

  bool has_log() const override { return copied_ >= kEnoughBytes || (is_ended_ && copied_ > 0); }
  void end_log() override { stop(); }
  void leave_log() override { stop(); }

 private:
  void stop() {
    ends_ = true;
    if (copier_.joinable()) copier_.join();
  }

  void copy() {
    try {
      std::vector<char> block(kBlockBytes);
      while (!ends_) {
        pollfd ready{STDIN_FILENO, POLLIN, 0};
        if (::poll(&ready, 1, kPatience_ms) <= 0) continue;
        const ssize_t got = ::read(STDIN_FILENO, block.data(), block.size());
        if (got < 0 && errno != EINTR && errno != EAGAIN)
          throw Error(ErrorCode::kMissing, "cannot be read: " + std::generic_category().message(errno),
                      "standard input", "pipe a log into it");
        if (got == 0) break;
        log_->add({block.data(), static_cast<std::size_t>(std::max<ssize_t>(got, 0))});
        copied_ = log_->bytes();
      }
    } catch (const Error& error) {
      trouble_ = error;
    }
    log_->finish();
    is_ended_ = true;
  }

  std::optional<rawlog::GrowingLog> log_;
  std::thread copier_;
  std::atomic<bool> ends_{false}, is_ended_{false};
  std::atomic<std::uint64_t> copied_{0};
  std::optional<Error> trouble_;  // once it has ended
};

}  // namespace

ExitCode serve_robot_by_input(RoleArguments arguments) {
  arguments.flags.set.emplace_back("reading.follow=true");
  InputAsLog input;
  return serve_robot(arguments, input);
}

}  // namespace mapweave::app
