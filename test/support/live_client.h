#pragma once
// A camera client with threads of its own, for cameras that do not wait: one follows the camera, another corrects the
// map after loops.

#include <mapweave/visual/visual_client.h>

#include <condition_variable>
#include <exception>
#include <thread>
#include <variant>

namespace mapweave::test {

// The same code as VisualClient's; only which frames it gets, and when a corrected map is applied, depend on how long
// things take. All calls are thread-safe.
class LiveClient {
 public:
  // Called on the tracking thread after each frame, which may talk to the client then; the next frame waits meanwhile.
  using Report = std::function<void(visual::VisualClient&, Stamp, const visual::Tracked&)>;
  LiveClient(Pinhole camera, double baseline_m, visual::ClientOptions options,
             std::optional<matching::BinaryVocabulary> vocabulary = std::nullopt, Report report = {});
  ~LiveClient();  // what waits is dropped, and no map is corrected any more
  LiveClient(const LiveClient&) = delete;
  LiveClient& operator=(const LiveClient&) = delete;

  // Never waits. A frame that waits already is dropped for this one. Contract as visual::VisualClient::add.
  void add(visual::Frame frame);
  void add(visual::FeatureFrame frame);
  // Until the last frame was tracked and what was pending is applied. Throws what a thread threw. The client is the
  // caller's from then on; no more frames come.
  visual::VisualClient& finish();
  int dropped() const;

 private:
  using AnyFrame = std::variant<visual::Frame, visual::FeatureFrame>;
  void wait_with(AnyFrame frame);
  void track();
  void correct_loops();
  void stop();
  void end();

  visual::VisualClient client_;  // of the tracking thread, until it has ended
  Report report_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<AnyFrame> waiting_;
  std::shared_ptr<BackgroundWork> work_;
  bool ending_ = false, stopped_ = false, given_up_ = false;
  int dropped_ = 0;
  std::exception_ptr error_;
  std::thread tracking_, correcting_;
  std::once_flag stopping_;
};

// Maps are corrected on the second thread, and applied when that is done.
inline visual::ClientOptions without_waiting(visual::ClientOptions options) {
  options.loops.wait = false;
  return options;
}

inline LiveClient::LiveClient(Pinhole camera, double baseline_m, visual::ClientOptions options,
                              std::optional<matching::BinaryVocabulary> vocabulary, Report report)
    : client_(camera, baseline_m, without_waiting(std::move(options)), std::move(vocabulary)),
      report_(std::move(report)),
      tracking_([this] { track(); }),
      correcting_([this] { correct_loops(); }) {}

inline LiveClient::~LiveClient() {
  {
    const std::lock_guard lock(mutex_);
    waiting_.reset();
    given_up_ = true;
  }
  stop();
}

inline void LiveClient::add(visual::Frame frame) { wait_with(std::move(frame)); }
inline void LiveClient::add(visual::FeatureFrame frame) { wait_with(std::move(frame)); }

inline void LiveClient::wait_with(AnyFrame frame) {
  const std::lock_guard lock(mutex_);
  if (ending_ || error_) return;
  if (waiting_) ++dropped_;
  waiting_ = std::move(frame);
  changed_.notify_all();
}

inline visual::VisualClient& LiveClient::finish() {
  stop();
  if (error_) std::rethrow_exception(error_);
  client_.finish();
  return client_;
}

inline int LiveClient::dropped() const {
  const std::lock_guard lock(mutex_);
  return dropped_;
}

inline void LiveClient::stop() {
  std::call_once(stopping_, [this] { end(); });
}

inline void LiveClient::end() {
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

inline void LiveClient::track() try {
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
          const visual::Tracked tracked = client_.add(one);
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

inline void LiveClient::correct_loops() try {
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

}  // namespace mapweave::test
