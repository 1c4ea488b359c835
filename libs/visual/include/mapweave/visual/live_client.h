#pragma once
// A camera client with threads of its own, for cameras that do not wait: one follows the camera, another corrects the
// map after loops.

#include <mapweave/visual/visual_client.h>

#include <condition_variable>
#include <exception>
#include <thread>
#include <variant>

namespace mapweave::visual {

// The same code as VisualClient's; only which frames it gets, and when a corrected map is applied, depend on how long
// things take. All calls are thread-safe.
class LiveClient {
 public:
  // Called on the tracking thread after each frame, which may talk to the client then; the next frame waits meanwhile.
  using Report = std::function<void(VisualClient&, Stamp, const Tracked&)>;
  LiveClient(Pinhole camera, double baseline_m, ClientOptions options,
             std::optional<matching::BinaryVocabulary> vocabulary = std::nullopt, Report report = {});
  ~LiveClient();  // what waits is dropped, and no map is corrected any more
  LiveClient(const LiveClient&) = delete;
  LiveClient& operator=(const LiveClient&) = delete;

  // Never waits. A frame that waits already is dropped for this one. Contract as VisualClient::add.
  void add(Frame frame);
  void add(FeatureFrame frame);
  // Until the last frame was tracked and what was pending is applied. Throws what a thread threw. The client is the
  // caller's from then on; no more frames come.
  VisualClient& finish();
  int dropped() const;

 private:
  using AnyFrame = std::variant<Frame, FeatureFrame>;
  void wait_with(AnyFrame frame);
  void track();
  void correct_loops();
  void stop();
  void end();

  VisualClient client_;  // of the tracking thread, until it has ended
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

}  // namespace mapweave::visual
