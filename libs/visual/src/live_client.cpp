#include <mapweave/visual/live_client.h>

#include <utility>

namespace mapweave::visual {
namespace {

ClientOptions live(ClientOptions options) {
  options.loops.wait = false;
  return options;
}

}  // namespace

LiveClient::LiveClient(Pinhole camera, double baseline_m, ClientOptions options,
                       std::optional<matching::BinaryVocabulary> vocabulary, Report report)
    : client_(camera, baseline_m, live(std::move(options)), std::move(vocabulary)),
      report_(std::move(report)),
      tracking_([this] { track(); }),
      correcting_([this] { correct_loops(); }) {}

LiveClient::~LiveClient() {
  {
    const std::lock_guard lock(mutex_);
    waiting_.reset();
    given_up_ = true;
  }
  stop();
}

void LiveClient::add(Frame frame) { wait_with(std::move(frame)); }
void LiveClient::add(FeatureFrame frame) { wait_with(std::move(frame)); }

void LiveClient::wait_with(AnyFrame frame) {
  const std::lock_guard lock(mutex_);
  if (ending_ || error_) return;
  if (waiting_) ++dropped_;
  waiting_ = std::move(frame);
  changed_.notify_all();
}

VisualClient& LiveClient::finish() {
  stop();
  if (error_) std::rethrow_exception(error_);
  client_.finish();
  return client_;
}

int LiveClient::dropped() const {
  const std::lock_guard lock(mutex_);
  return dropped_;
}

void LiveClient::stop() {
  std::call_once(stopping_, [this] { end(); });
}

void LiveClient::end() {
  {
    const std::lock_guard lock(mutex_);
    ending_ = true;
    changed_.notify_all();
  }
  if (tracking_.joinable()) tracking_.join();
  {
    const std::lock_guard lock(mutex_);
    stopped_ = true;
    changed_.notify_all();
  }
  if (correcting_.joinable()) correcting_.join();
}

void LiveClient::track() try {
  while (true) {
    AnyFrame frame;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [this] { return waiting_ || ending_; });
      if (!waiting_) return;
      frame = std::move(*waiting_);
      waiting_.reset();
    }
    std::visit(
        [this](const auto& one) {
          const Tracked tracked = client_.add(one);
          if (report_) report_(client_, one.stamp, tracked);
        },
        frame);
    const std::lock_guard lock(mutex_);
    work_ = client_.pending();
    if (work_) changed_.notify_all();
  }
} catch (...) {
  const std::lock_guard lock(mutex_);
  error_ = std::current_exception();
}

void LiveClient::correct_loops() try {
  while (true) {
    std::shared_ptr<BackgroundWork> work;
    {
      std::unique_lock lock(mutex_);
      changed_.wait(lock, [this] { return (work_ && !work_->is_done()) || stopped_; });
      if (given_up_ || !work_ || work_->is_done()) return;
      work = work_;
    }
    work->run();
  }
} catch (...) {
  const std::lock_guard lock(mutex_);
  error_ = std::current_exception();
  work_.reset();
}

}  // namespace mapweave::visual
