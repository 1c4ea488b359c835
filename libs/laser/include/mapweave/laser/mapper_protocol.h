#pragma once
// What the program and its helper mrpt_mapper say to each other over a byte stream. Header only, so that the helper
// need not link this library and all that it uses.
//
//   frame := length u32 (little-endian, 1 to kMaxFrameBytes), a message of maps/mapper_messages.h in as many bytes
//   to the helper:    EngineStart (Sensed | PosesWanted)*, the last of them a StreamEnd
//   to the program:   MapperProgress* (ScanPoses+ MapperProgress*)* (ScanPoses+ | Refusal)
// A helper whose stream ends before that leaves at once: the program is gone.

#include <mapweave/laser/mrpt_options.h>
#include <mapweave/maps/mapper_messages.h>

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace mapweave::laser::protocol {

inline constexpr std::uint32_t kMaxFrameBytes = 1 << 20;
inline constexpr std::uint32_t kMaxRays = 100'000;
inline constexpr std::size_t kPosesPerFrame = 4096;
inline constexpr char kStream[] = "stream of mrpt_mapper";

using EngineOptions = std::variant<RbpfOptions, IcpOptions>;
inline constexpr const char* kEngines[] = {"rbpf", "icp"};  // by index

[[noreturn]] inline void fail(const std::string& what) { throw Error(ErrorCode::kCorrupt, what, kStream); }

// Contract: it fits.
template <class Message>
std::string framed(const Message& message) {
  const std::string bytes = encode(message);
  MAPWEAVE_EXPECT(!bytes.empty() && bytes.size() <= kMaxFrameBytes, "frame too long");
  std::string frame;
  for (int i = 0; i < 4; ++i) frame.push_back(static_cast<char>(bytes.size() >> (8 * i) & 0xff));
  return frame + bytes;
}

// Cuts a byte stream into messages. Holds at most one frame and what was fed last.
class FrameParser {
 public:
  void feed(std::string_view bytes) {
    buffer_.erase(0, used_).append(bytes);
    used_ = 0;
  }
  // Valid until more is fed.
  std::optional<std::string_view> next() {
    const auto waiting = std::string_view(buffer_).substr(used_);
    if (waiting.size() < 4) return std::nullopt;
    std::uint32_t length = 0;
    for (std::size_t i = 0; i < 4; ++i) length |= std::uint32_t{static_cast<unsigned char>(waiting[i])} << (8 * i);
    if (length == 0 || length > kMaxFrameBytes)
      fail("a frame of " + std::to_string(length) + " bytes; 1 to " + std::to_string(kMaxFrameBytes) + " are possible");
    if (waiting.size() - 4 < length) return std::nullopt;
    used_ += 4 + std::size_t{length};
    return waiting.substr(4, length);
  }

 private:
  std::string buffer_;
  std::size_t used_ = 0;  // bytes of buffer_ that were given out
};

// Options travel by name, one after the other: describe() is their only list. All of their values are numbers.
class OptionsWriter {
 public:
  explicit OptionsWriter(EngineStart& out) : out_(out) {}
  void positive(const char* name, double& value, const char*) { put(name, value); }
  void non_negative(const char* name, double& value, const char*) { put(name, value); }
  void fraction(const char* name, double& value, const char*) { put(name, value); }
  void number(const char* name, double& value, double, double, const char*) { put(name, value); }
  template <class Integer>
  void integer(const char* name, Integer& value, std::int64_t, std::int64_t, const char*) {
    put(name, static_cast<double>(value));
  }
  void flag(const char* name, bool& value, const char*) { put(name, value ? 1.0 : 0.0); }
  template <class Section>
  void section(const char*, Section& section, const char*) {
    section.describe(*this);
  }

 private:
  void put(const char* name, double value) { out_.options.push_back({name, value}); }
  EngineStart& out_;
};

class OptionsReader {
 public:
  explicit OptionsReader(const EngineStart& in) : in_(in) {}
  void positive(const char* name, double& value, const char*) { value = take(name, 1e-12, 1e12); }
  void non_negative(const char* name, double& value, const char*) { value = take(name, 0.0, 1e12); }
  void fraction(const char* name, double& value, const char*) { value = take(name, 0.0, 1.0); }
  void number(const char* name, double& value, double low, double high, const char*) { value = take(name, low, high); }
  template <class Integer>
  void integer(const char* name, Integer& value, std::int64_t low, std::int64_t high, const char*) {
    const double number = take(name, static_cast<double>(low), static_cast<double>(high));
    if (number != std::floor(number)) fail(std::string("option ") + name + " is no whole number");
    value = static_cast<Integer>(number);
  }
  void flag(const char* name, bool& value, const char*) { value = take(name, 0.0, 1.0) != 0.0; }
  template <class Section>
  void section(const char*, Section& section, const char*) {
    section.describe(*this);
  }
  void expect_end() const {
    if (next_ != in_.options.size()) fail("there are options that this mrpt_mapper does not know");
  }

 private:
  double take(const char* name, double low, double high) {
    if (next_ == in_.options.size() || in_.options[next_].name != name)
      fail(std::string("option ") + name + " is not where this mrpt_mapper expects it");
    const double value = in_.options[next_++].value;
    if (!(value >= low && value <= high)) fail(std::string("option ") + name + " is " + std::to_string(value));
    return value;
  }
  const EngineStart& in_;
  std::size_t next_ = 0;
};

inline EngineStart start_of(EngineOptions options) {
  EngineStart start{kEngines[options.index()], {}};
  OptionsWriter fields(start);
  std::visit([&](auto& engine) { engine.describe(fields); }, options);
  return start;
}
inline EngineOptions options_of(const EngineStart& start) {
  EngineOptions options;
  if (start.engine == kEngines[1])
    options = IcpOptions{};
  else if (start.engine != kEngines[0])
    fail("engine '" + start.engine + "' is unknown");
  OptionsReader fields(start);
  std::visit([&](auto& chosen) { chosen.describe(fields); }, options);
  fields.expect_end();
  return options;
}

// What MRPT can take of a laser.
inline void expect_usable(const ScanGeometry& geometry) {
  if (geometry.ray_count < 2 || geometry.ray_count > kMaxRays)
    fail("a laser of " + std::to_string(geometry.ray_count) + " rays; 2 to 100000 are possible");
  if (!(std::abs(geometry.angle_step_rad) * geometry.ray_count <= 13.0) || geometry.angle_step_rad == 0.0)
    fail("a laser's rays cover more than two turns, or nothing");
  if (geometry.range_unit_m > 1.0) fail("a laser's range unit is out of range");
}

// As many frames as it takes, the last of which says so.
inline std::string frames_of(const std::vector<ScanPose>& poses) {
  std::string frames;
  std::size_t begin = 0;
  do {
    const std::size_t end = std::min(poses.size(), begin + kPosesPerFrame);
    const auto first = poses.begin() + static_cast<std::ptrdiff_t>(begin);
    frames += framed(ScanPoses{{first, poses.begin() + static_cast<std::ptrdiff_t>(end)}, end == poses.size()});
    begin = end;
  } while (begin < poses.size());
  return frames;
}

}  // namespace mapweave::laser::protocol
