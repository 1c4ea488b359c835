#pragma once
// Picks a few frames for a contact sheet while nobody knows yet how long the recording is.

#include <mapweave/exporters/contact_sheet.h>
#include <mapweave/visual/frame.h>
#include <mapweave/visual/visual_client.h>

#include <deque>

namespace mapweave::runtime {

class SheetCollector {
 public:
  // Of every frame, in order; `seen` is empty where it was not tracked.
  void add(const visual::Frame& frame, const std::vector<visual::SeenLandmark>& seen, double since_start_s);
  std::vector<exporters::SheetFrame> take() { return std::move(frames_); }

 private:
  std::deque<std::vector<visual::SeenLandmark>> before_;  // of the latest frames, the newest last
  std::vector<exporters::SheetFrame> frames_;
  std::uint64_t count_ = 0, stride_ = 1;
};

}  // namespace mapweave::runtime
