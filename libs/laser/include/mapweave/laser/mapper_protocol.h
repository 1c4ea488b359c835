#pragma once
// What the program and its helper mrpt_mapper say to each other over a byte stream. Header only, so that the helper
// need not link this library and all that it uses.
//
//   frame  := length u32, kind u8, body[length - 1]       little-endian; 1 <= length <= kMaxFrameBytes
//   to the helper:    start (options geometry* (odometry | geometry | scan)*) end
//     start    := "MWMM", version u8, engine u8 (0 rbpf, 1 icp), the options' fields in the order of their describe()
//     geometry := first_angle f64, step f64, rays u32, max_range f64, unit f64, robot_from_laser: t 3 f64, q (w, x, y,
//     z) 4 f64 scan     := stamp i64 (ns), ranges u16[rays of the last geometry] odometry := stamp i64 (ns),
//     odometry_from_robot: x f64, y f64, yaw f64 end      := nothing
//   to the program:   (progress)* ((poses)* done | failed)
//     progress := scans finished so far u64
//     poses    := pose[], in the order of the scans; pose := map_from_robot 3 f64, previous_from_this 3 f64, by_wheels
//     u8 done     := number of poses u64 failed   := text, UTF-8
// A helper whose stream ends before `end` leaves at once: the program is gone.

#include <mapweave/core/error.h>
#include <mapweave/core/geometry.h>
#include <mapweave/core/stamp.h>
#include <mapweave/laser/mrpt_options.h>
#include <mapweave/maps/scan.h>

#include <algorithm>
#include <cmath>
#include <cstring>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <variant>
#include <vector>

namespace mapweave::laser::protocol {

inline constexpr char kMagic[] = "MWMM";
inline constexpr std::uint8_t kVersion = 2;
inline constexpr std::uint32_t kMaxFrameBytes = 1 << 20;
inline constexpr std::uint32_t kMaxRays = 100'000;
inline constexpr std::size_t kPosesPerFrame = 4096;

enum class Kind : std::uint8_t {
  start = 1,
  geometry = 2,
  scan = 3,
  odometry = 4,
  end = 5,
  progress = 16,
  poses = 17,
  done = 18,
  failed = 19
};

using EngineOptions = std::variant<RbpfOptions, IcpOptions>;  // index: engine

struct ScanPose {
  Pose2 map_from_robot;
  Pose2 previous_from_this;  // motion since the previous scan, before any map was consulted; identity for the first
  bool by_wheels = false;    // measured by odometry, not by matching scans
};

struct MapperFrame {
  Kind kind{};
  std::string body;
};

[[noreturn]] inline void fail(const std::string& what) {
  throw Error(ErrorCode::kCorrupt, what, "stream of mrpt_mapper");
}

class Writer {
 public:
  template <class Integer, class = std::enable_if_t<std::is_integral_v<Integer>>>
  Writer& add(Integer value) {
    for (std::size_t i = 0; i < sizeof(Integer); ++i)
      bytes_.push_back(static_cast<char>(static_cast<std::make_unsigned_t<Integer>>(value) >> (8 * i) & 0xff));
    return *this;
  }
  Writer& add(double value) {
    std::uint64_t bits;
    std::memcpy(&bits, &value, sizeof bits);
    return add(bits);
  }
  Writer& add(const Pose2& pose) { return add(pose.x).add(pose.y).add(pose.phi); }
  Writer& add_text(std::string_view text) { return bytes_.append(text), *this; }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
};

class Reader {
 public:
  explicit Reader(std::string_view bytes) : left_(bytes) {}
  template <class Integer>
  Integer integer() {
    std::uint64_t value = 0;
    const auto bytes = text(sizeof(Integer));
    for (std::size_t i = 0; i < sizeof(Integer); ++i)
      value |= std::uint64_t{static_cast<unsigned char>(bytes[i])} << (8 * i);
    return static_cast<Integer>(value);
  }
  double number() {  // finite
    const auto bits = integer<std::uint64_t>();
    double value;
    std::memcpy(&value, &bits, sizeof value);
    if (!std::isfinite(value)) fail("a number is not finite");
    return value;
  }
  Pose2 pose() {
    const double x = number(), y = number();
    return {x, y, number()};
  }
  std::string_view text(std::size_t size) {
    if (size > left_.size())
      fail("a frame ends early: " + std::to_string(size) + " bytes expected, " + std::to_string(left_.size()) +
           " remain");
    const auto bytes = left_.substr(0, size);
    left_.remove_prefix(size);
    return bytes;
  }
  std::size_t left() const { return left_.size(); }
  void expect_end() const {
    if (!left_.empty()) fail("a frame has " + std::to_string(left_.size()) + " bytes too many");
  }

 private:
  std::string_view left_;
};

// A frame's bytes. Contract: it fits.
inline std::string framed(Kind kind, std::string_view body = {}) {
  MAPWEAVE_EXPECT(body.size() < kMaxFrameBytes, "frame too long");
  return Writer()
      .add(static_cast<std::uint32_t>(body.size() + 1))
      .add(static_cast<std::uint8_t>(kind))
      .add_text(body)
      .bytes();
}

// Cuts a byte stream into frames. Holds at most one frame and what was fed last.
class FrameParser {
 public:
  void feed(std::string_view bytes) {
    buffer_.erase(0, used_).append(bytes);
    used_ = 0;
  }
  std::optional<MapperFrame> next() {
    const auto waiting = std::string_view(buffer_).substr(used_);
    if (waiting.size() < 4) return std::nullopt;
    const auto length = Reader(waiting).integer<std::uint32_t>();
    if (length == 0 || length > kMaxFrameBytes)
      fail("a frame of " + std::to_string(length) + " bytes; 1 to " + std::to_string(kMaxFrameBytes) + " are possible");
    if (waiting.size() < 4 + std::size_t{length}) return std::nullopt;
    used_ += 4 + std::size_t{length};
    return MapperFrame{static_cast<Kind>(waiting[4]), std::string(waiting.substr(5, length - 1))};
  }

 private:
  std::string buffer_;
  std::size_t used_ = 0;  // bytes of buffer_ that were given out
};

// Options travel field by field: describe() is their only list.
class OptionsWriter {
 public:
  explicit OptionsWriter(Writer& out) : out_(out) {}
  void positive(const char*, double& value, const char*) { out_.add(value); }
  void non_negative(const char*, double& value, const char*) { out_.add(value); }
  void fraction(const char*, double& value, const char*) { out_.add(value); }
  void number(const char*, double& value, double, double, const char*) { out_.add(value); }
  template <class Integer>
  void integer(const char*, Integer& value, std::int64_t, std::int64_t, const char*) {
    out_.add(static_cast<std::int64_t>(value));
  }
  void flag(const char*, bool& value, const char*) { out_.add(static_cast<std::uint8_t>(value)); }
  template <class Section>
  void section(const char*, Section& section, const char*) {
    section.describe(*this);
  }

 private:
  Writer& out_;
};

class OptionsReader {
 public:
  explicit OptionsReader(Reader& in) : in_(in) {}
  void positive(const char* name, double& value, const char*) { take(name, value, 1e-12, 1e12); }
  void non_negative(const char* name, double& value, const char*) { take(name, value, 0.0, 1e12); }
  void fraction(const char* name, double& value, const char*) { take(name, value, 0.0, 1.0); }
  void number(const char* name, double& value, double low, double high, const char*) { take(name, value, low, high); }
  template <class Integer>
  void integer(const char* name, Integer& value, std::int64_t low, std::int64_t high, const char*) {
    const auto number = in_.integer<std::int64_t>();
    if (number < low || number > high) fail(std::string("option ") + name + " is " + std::to_string(number));
    value = static_cast<Integer>(number);
  }
  void flag(const char*, bool& value, const char*) { value = in_.integer<std::uint8_t>() != 0; }
  template <class Section>
  void section(const char*, Section& section, const char*) {
    section.describe(*this);
  }

 private:
  void take(const char* name, double& value, double low, double high) {
    value = in_.number();
    if (value < low || value > high) fail(std::string("option ") + name + " is " + std::to_string(value));
  }
  Reader& in_;
};

inline std::string encode_start(EngineOptions options) {
  Writer out;
  out.add_text(kMagic).add(kVersion).add(static_cast<std::uint8_t>(options.index()));
  OptionsWriter fields(out);
  std::visit([&](auto& engine) { engine.describe(fields); }, options);
  return framed(Kind::start, out.bytes());
}
inline EngineOptions decode_start(std::string_view body) {
  Reader in(body);
  if (in.text(4) != kMagic) fail("the stream does not begin with " + std::string(kMagic));
  if (const auto version = in.integer<std::uint8_t>(); version != kVersion)
    fail("protocol version " + std::to_string(version) + "; this mrpt_mapper speaks " + std::to_string(kVersion));
  EngineOptions options;
  const auto engine = in.integer<std::uint8_t>();
  if (engine > 1) fail("engine " + std::to_string(engine) + " is unknown");
  if (engine == 1) options = IcpOptions{};
  OptionsReader fields(in);
  std::visit([&](auto& chosen) { chosen.describe(fields); }, options);
  in.expect_end();
  return options;
}

inline std::string encode(const ScanGeometry& geometry) {
  const auto& [t, q] = geometry.robot_from_laser;
  Writer out;
  out.add(geometry.first_angle_rad)
      .add(geometry.angle_step_rad)
      .add(geometry.ray_count)
      .add(geometry.max_range_m)
      .add(geometry.range_unit_m);
  out.add(t.x()).add(t.y()).add(t.z()).add(q.w()).add(q.x()).add(q.y()).add(q.z());
  return framed(Kind::geometry, out.bytes());
}
inline ScanGeometry decode_geometry(std::string_view body) {
  Reader in(body);
  ScanGeometry geometry;
  geometry.first_angle_rad = in.number();
  geometry.angle_step_rad = in.number();
  geometry.ray_count = in.integer<std::uint32_t>();
  geometry.max_range_m = in.number();
  geometry.range_unit_m = in.number();
  for (int i = 0; i < 3; ++i) geometry.robot_from_laser.t[i] = in.number();
  const double w = in.number(), x = in.number(), y = in.number();
  geometry.robot_from_laser.q = Eigen::Quaterniond(w, x, y, in.number());
  in.expect_end();
  if (geometry.ray_count < 2 || geometry.ray_count > kMaxRays)
    fail("a laser of " + std::to_string(geometry.ray_count) + " rays; 2 to 100000 are possible");
  if (!(std::abs(geometry.angle_step_rad) * geometry.ray_count <= 13.0) || geometry.angle_step_rad == 0.0)
    fail("a laser's rays cover more than two turns, or nothing");
  if (!(geometry.range_unit_m > 0.0 && geometry.range_unit_m <= 1.0) || !(geometry.max_range_m > 0.0))
    fail("a laser's range unit or maximum is out of range");
  if (std::abs(geometry.robot_from_laser.q.norm() - 1.0) > 1e-6) fail("a laser's rotation is not a unit quaternion");
  return geometry;
}

inline std::string encode_scan(Stamp stamp, const PackedScan& scan) {
  Writer out;
  out.add(stamp.ns);
  for (const std::uint16_t range : scan.ranges) out.add(range);
  return framed(Kind::scan, out.bytes());
}
struct DecodedScan {
  Stamp stamp;
  PackedScan scan;
};
inline DecodedScan decode_scan(std::string_view body, const std::shared_ptr<const ScanGeometry>& geometry) {
  if (!geometry) fail("a scan before any geometry");
  Reader in(body);
  DecodedScan decoded{{in.integer<std::int64_t>()}, {geometry, std::vector<std::uint16_t>(geometry->ray_count)}};
  for (std::uint16_t& range : decoded.scan.ranges) range = in.integer<std::uint16_t>();
  in.expect_end();
  return decoded;
}

inline std::string encode_odometry(Stamp stamp, const Pose2& odometry_from_robot) {
  return framed(Kind::odometry, Writer().add(stamp.ns).add(odometry_from_robot).bytes());
}
struct DecodedOdometry {
  Stamp stamp;
  Pose2 odometry_from_robot;
};
inline DecodedOdometry decode_odometry(std::string_view body) {
  Reader in(body);
  const Stamp stamp{in.integer<std::int64_t>()};
  const DecodedOdometry decoded{stamp, in.pose()};
  in.expect_end();
  return decoded;
}

inline std::string encode_count(Kind kind, std::uint64_t count) { return framed(kind, Writer().add(count).bytes()); }
inline std::uint64_t decode_count(std::string_view body) {
  Reader in(body);
  const auto count = in.integer<std::uint64_t>();
  in.expect_end();
  return count;
}

// As many frames as it takes.
inline std::string encode_poses(const std::vector<ScanPose>& poses) {
  std::string frames;
  for (std::size_t begin = 0; begin < poses.size(); begin += kPosesPerFrame) {
    Writer out;
    for (std::size_t i = begin; i < std::min(poses.size(), begin + kPosesPerFrame); ++i)
      out.add(poses[i].map_from_robot)
          .add(poses[i].previous_from_this)
          .add(static_cast<std::uint8_t>(poses[i].by_wheels));
    frames += framed(Kind::poses, out.bytes());
  }
  return frames;
}
inline std::vector<ScanPose> decode_poses(std::string_view body) {
  Reader in(body);
  std::vector<ScanPose> poses;
  while (in.left() > 0) {
    const Pose2 map_from_robot = in.pose(), previous_from_this = in.pose();
    poses.push_back({map_from_robot, previous_from_this, in.integer<std::uint8_t>() != 0});
  }
  return poses;
}

}  // namespace mapweave::laser::protocol
