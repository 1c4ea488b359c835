#pragma once
// A camera client with threads of its own, for cameras that do not wait: one follows the camera, another straightens the map after loops.

#include <mapweave/visual/visual_client.h>

#include <condition_variable>
#include <exception>
#include <thread>

namespace mapweave::visual {

// The same code as VisualClient's; only which frames it gets, and when a straightened map is applied, depend on how long things take.
// All calls are thread-safe.
class LiveClient {
 public:
  using Report = std::function<void(Stamp, const Tracked&)>;  // called on the tracking thread
  LiveClient(PinholeCamera camera, double baseline_m, ClientOptions options,
             std::optional<matching::BinaryVocabulary> vocabulary = std::nullopt, Report report = {});
  ~LiveClient();  // what waits is dropped
  LiveClient(const LiveClient&) = delete;
  LiveClient& operator=(const LiveClient&) = delete;

  // Never waits. A frame that waits already is dropped for this one. Contract as VisualClient::add.
  void add(Frame frame);
  // Until the last frame was tracked and what was pending is applied. Throws what a thread threw. The client may be read from then on; no
  // more frames come.
  const VisualClient& finish();
  int dropped() const;

 private:
  void track();
  void straighten();
  void stop();

  VisualClient client_;  // of the tracking thread, until it has ended
  Report report_;
  mutable std::mutex mutex_;
  std::condition_variable changed_;
  std::optional<Frame> waiting_;
  std::shared_ptr<BackgroundWork> work_;
  bool ending_ = false, stopped_ = false;
  int dropped_ = 0;
  std::exception_ptr error_;
  std::thread tracking_, straightening_;
};

}  // namespace mapweave::visual
