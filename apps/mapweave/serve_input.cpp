// mapweave serve robot --stdin: a robot whose log comes through standard input.

#include "serve.h"

#include <mapweave/core/error.h>
#include <mapweave/core/log.h>
#include <mapweave/rawlog/growing_log.h>
#include <poll.h>
#include <unistd.h>

#include <algorithm>
#include <atomic>
#include <cerrno>
#include <optional>
#include <string_view>
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
      if (robot.id.str() == name) open(robot);
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
  // A recording that was not all sent is gone on with.
  void open(const runtime::PlannedRobot& robot) {
    using Begin = rawlog::GrowingLog::Begin;
    const rawlog::UnsentMark unsent(robot.log);
    std::error_code ignored;
    const bool is_kept = unsent.is_set() && std::filesystem::exists(robot.log, ignored);
    log_.emplace(robot.log, is_kept ? Begin::existing_file : Begin::new_file);
    unsent.set();
    kept_ = log_->bytes();
    copied_ = kept_;
    if (kept_ > 0)
      log(LogLevel::info, "robot " + robot.id.str() + " goes on with " + robot.log.string() + ", which holds " +
                              std::to_string(kept_) + " bytes that an earlier program kept");
  }

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
        std::string_view news(block.data(), static_cast<std::size_t>(std::max<ssize_t>(got, 0)));
        pass_over_kept(news);
        log_->add(news);
        copied_ = log_->bytes();
      }
    } catch (const Error& error) {
      trouble_ = error;
    }
    log_->finish();
    is_ended_ = true;
  }

  // The input begins again with what is kept already.
  void pass_over_kept(std::string_view& news) {
    const std::size_t count = std::min<std::uint64_t>(kept_ - compared_, news.size());
    std::vector<char> kept(count);
    if (log_->read_at(compared_, kept.data(), count) != count || !std::equal(kept.begin(), kept.end(), news.begin()))
      throw Error(ErrorCode::kBadInput,
                  "brings another drive than the one that an earlier program kept, not all of which was sent: " +
                      log_->path().string(),
                  "standard input",
                  "run the same command without --stdin: it sends the kept drive; then name another file as the "
                  "robot's `log`");
    compared_ += count;
    news.remove_prefix(count);
  }

  std::optional<rawlog::GrowingLog> log_;
  std::uint64_t kept_ = 0, compared_ = 0;  // bytes of an earlier program; of these, what the input brought again
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
