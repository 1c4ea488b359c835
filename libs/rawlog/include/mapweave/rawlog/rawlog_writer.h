#pragma once
// Writes observations as an MRPT rawlog (observations only, gz), which MRPT's own programs read too.

#include <mrpt/obs/CObservation.h>

#include <cstdint>
#include <filesystem>
#include <memory>

namespace mapweave::rawlog {

// Written beside `path` and renamed into place by close(); without close() nothing is left.
class RawlogWriter {
 public:
  explicit RawlogWriter(std::filesystem::path path);  // throws Error kCannotWrite, as do the others
  ~RawlogWriter();
  RawlogWriter(const RawlogWriter&) = delete;
  RawlogWriter& operator=(const RawlogWriter&) = delete;
  // Pictures that lie outside the log stay there: their absolute path is written.
  void add(const mrpt::obs::CObservation&);
  void close();  // once; no add() after
  std::uint64_t count() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace mapweave::rawlog
