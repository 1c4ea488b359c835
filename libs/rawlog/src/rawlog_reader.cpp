// MRPT rawlogs of either form: observations alone, or pairs of actions and sensory frames. Not with MRPT's CRawlog: it
// takes damage for the end.

#include "external_images.h"
#include "formats.h"
#include "object_walk.h"
#include "source_archive.h"

#include <mapweave/core/geometry.h>
#include <mrpt/obs/CActionRobotMovement2D.h>
#include <mrpt/obs/CActionRobotMovement3D.h>
#include <mrpt/obs/CObservationComment.h>
#include <mrpt/obs/CObservationOdometry.h>
#include <mrpt/obs/registerAllClasses.h>

#include <algorithm>
#include <map>
#include <mutex>
#include <new>
#include <optional>
#include <sstream>
#include <string_view>

namespace mapweave::rawlog {
namespace {

constexpr std::uint8_t kEndFlag = 0x88;
constexpr const char* kOdometryLabel = "ODOMETRY";  // of odometry that came as increments

using Object = mrpt::serialization::CSerializable::Ptr;

// The first of MRPT's own words that say something: without banners and labels, and without "an object cannot be read",
// which is reported anyway.
std::string reason_of(const std::string& message) {
  constexpr std::string_view kLabel = "Message:";
  std::istringstream lines(message);
  for (std::string line; std::getline(lines, line);) {
    if (line.rfind(kLabel, 0) == 0) line.erase(0, kLabel.size());
    const auto begin = line.find_first_not_of(" \t\r");
    if (begin == std::string::npos) continue;
    const auto starts_with = [&](std::string_view start) { return line.compare(begin, start.size(), start) == 0; };
    if (starts_with("=") || starts_with("Exception while parsing") || starts_with("Original exception")) continue;
    if (starts_with("Location:") || starts_with("Call back")) continue;
    return line.substr(begin, 160);
  }
  return "MRPT gives no reason";
}

class RawlogReader final : public RecordSource {
 public:
  RawlogReader(std::unique_ptr<ByteSource> bytes, const ReadOptions& options)
      : bytes_(std::move(bytes)),
        archive_(*bytes_),
        most_bytes_(static_cast<std::uint64_t>(options.max_object_mb * 1e6)),
        images_(images_folder(bytes_->path())) {
    static std::once_flag registered;  // a program that only reads would not load the classes otherwise
    std::call_once(registered, [] { mrpt::obs::registerAllClasses_mrpt_obs(); });
  }

  bool read(std::vector<PlacedRecord>& records) override {
    if (bytes_->at_end()) return false;
    const std::uint64_t place = bytes_->position();
    const ObjectHeader header = check_object(*bytes_, most_bytes_);
    archive_.start_object(most_bytes_);
    if (header.short_name() == "CSensoryFrame") {
      read_frame(header, place, records);
    } else if (header.short_name() == "CActionCollection") {
      bytes_->skip(header.bytes());
      add_actions(read_objects(header, place), place, records);
    } else if (const auto object = read_object(header, place)) {
      const auto observation = std::dynamic_pointer_cast<mrpt::obs::CObservation>(object);
      const auto action = observation ? nullptr : std::dynamic_pointer_cast<mrpt::obs::CAction>(object);
      if (observation) add(observation, std::nullopt, place, records);
      if (action) add_movement(*action, place, records);
      if (!observation && !action) ++others_[object->GetRuntimeClass()->className];
    }
    return true;
  }

  std::exception_ptr cause_of(std::exception_ptr seen) override { return bytes_->cause_of(std::move(seen)); }
  std::string place_name(std::uint64_t place) const override { return bytes_->place(place); }
  std::string path() const override { return bytes_->path().string(); }
  std::uint64_t bytes_read() const override { return bytes_->file_bytes_read(); }
  std::uint64_t bytes_total() const override { return bytes_->file_bytes(); }
  std::string nothing_found() const override {
    std::string text;
    for (const auto& [name, count] : others_) text += (text.empty() ? "" : ", ") + std::to_string(count) + " " + name;
    return text;
  }

 private:
  template <class Number>
  Number take(const ObjectHeader& header, std::uint64_t place) {  // little-endian, as MRPT writes
    Number number;
    if (bytes_->take(reinterpret_cast<char*>(&number), sizeof number)) return number;
    bytes_->throw_damage();
    throw corrupt(header, place, "it is cut short");
  }

  Error corrupt(const ObjectHeader& header, std::uint64_t place, const std::string& what) const {
    return Error(ErrorCode::kCorrupt,
                 "an object of class '" + std::string(header.class_name()) + "' cannot be decoded (" + what + ")",
                 bytes_->place(place),
                 "record or copy the log again; slam and run map what precedes this place with --keep-going");
  }

  // `header`: of the object, or of the collection it stands in.
  Object read_object(const ObjectHeader& header, std::uint64_t place) {
    try {
      return archive_.ReadObject();
    } catch (const std::bad_alloc&) {
      throw corrupt(header, place, "it announces more than the memory can hold");
    } catch (const std::length_error&) {
      throw corrupt(header, place, "it announces more than the memory can hold");
    } catch (const std::exception& problem) {
      archive_.rethrow_failure();
      throw corrupt(header, place, reason_of(problem.what()));
    } catch (...) {
      throw corrupt(header, place, "MRPT gives no reason");
    }
  }

  // The objects of a collection or a frame, one by one: MRPT itself dereferences a null among them.
  std::vector<Object> read_objects(const ObjectHeader& header, std::uint64_t place) {
    std::vector<Object> objects;  // grows as they come: the number may be damaged
    for (auto left = take<std::uint32_t>(header, place); left > 0; --left) {
      if (!header.is_known) check_object(*bytes_, most_bytes_);  // one that is not known hid those behind it
      objects.push_back(read_object(header, place));
    }
    if (header.has_end_flag && take<std::uint8_t>(header, place) != kEndFlag)
      throw corrupt(header, place, "its end flag is missing");
    return objects;
  }

  void read_frame(const ObjectHeader& header, std::uint64_t place, std::vector<PlacedRecord>& records) {
    bytes_->skip(header.bytes());
    std::optional<mrpt::Clock::time_point> of_all;  // version 0 has one stamp for all
    if (header.version < 2) take<std::uint32_t>(header, place);
    if (header.version == 0) of_all = mrpt::Clock::time_point(mrpt::Clock::duration(take<std::int64_t>(header, place)));
    std::vector<mrpt::obs::CObservation::Ptr> observations;
    std::optional<Stamp> earliest;
    for (const auto& object : read_objects(header, place)) {
      const auto observation = std::dynamic_pointer_cast<mrpt::obs::CObservation>(object);
      if (!observation) continue;
      if (of_all) observation->timestamp = *of_all;
      observations.push_back(observation);
      if (!has_stamp(observation->timestamp)) continue;
      const Stamp stamp = to_stamp(observation->timestamp);
      earliest = earliest ? std::min(*earliest, stamp) : stamp;
    }
    if (odometry_waits_ && earliest) add_odometry(*earliest, place, records);
    for (const auto& observation : observations) add(observation, earliest, place, records);
  }

  void add(const mrpt::obs::CObservation::Ptr& observation, std::optional<Stamp> otherwise, std::uint64_t place,
           std::vector<PlacedRecord>& records) {
    if (IS_CLASS(*observation, mrpt::obs::CObservationComment)) {  // stamped, if at all, by who wrote it and when
      ++others_[observation->GetRuntimeClass()->className];
      return;
    }
    const bool stamped = has_stamp(observation->timestamp);
    if (!stamped && !otherwise) {
      throw Error(ErrorCode::kBadInput,
                  "an observation of '" + observation->sensorLabel + "' (" + observation->GetRuntimeClass()->className +
                      ") has no time stamp; one was expected",
                  bytes_->place(place), "stamp the log when recording it");
    }
    const Stamp stamp = stamped ? to_stamp(observation->timestamp) : *otherwise;
    observation->timestamp = to_mrpt_time(stamp);
    make_image_paths_absolute(*observation, images_);
    records.push_back({{stamp, observation}, place});
  }

  void add_actions(const std::vector<Object>& actions, std::uint64_t place, std::vector<PlacedRecord>& records) {
    // Wheel odometry is preferred to what was computed from scans.
    const mrpt::obs::CAction* chosen = nullptr;
    for (const auto& object : actions) {
      const auto* movement = dynamic_cast<const mrpt::obs::CActionRobotMovement2D*>(object.get());
      const bool from_wheels =
          movement != nullptr && movement->estimationMethod == mrpt::obs::CActionRobotMovement2D::emOdometry;
      const bool is_movement =
          movement != nullptr || dynamic_cast<const mrpt::obs::CActionRobotMovement3D*>(object.get()) != nullptr;
      if (is_movement && (chosen == nullptr || from_wheels))
        chosen = dynamic_cast<const mrpt::obs::CAction*>(object.get());
      if (from_wheels) break;
    }
    if (chosen != nullptr) add_movement(*chosen, place, records);
  }

  void add_movement(const mrpt::obs::CAction& action, std::uint64_t place, std::vector<PlacedRecord>& records) {
    mrpt::math::TPose2D increment;
    if (const auto* in_plane = dynamic_cast<const mrpt::obs::CActionRobotMovement2D*>(&action)) {
      if (in_plane->estimationMethod == mrpt::obs::CActionRobotMovement2D::emOdometry) {
        increment = in_plane->rawOdometryIncrementReading.asTPose();
      } else if (in_plane->poseChange) {
        increment = in_plane->poseChange->getMeanVal().asTPose();
      }
    } else if (const auto* in_space = dynamic_cast<const mrpt::obs::CActionRobotMovement3D*>(&action)) {
      increment = mrpt::math::TPose2D(in_space->poseChange.mean.asTPose());
    } else {
      ++others_[action.GetRuntimeClass()->className];
      return;
    }
    if (!is_finite(increment)) {
      throw Error(ErrorCode::kBadInput, "an odometry increment is not a number; finite x, y, heading were expected",
                  bytes_->place(place), "map what precedes it with --keep-going");
    }
    odometry_from_robot_ = compose(odometry_from_robot_, increment);
    odometry_waits_ = !has_stamp(action.timestamp);
    if (!odometry_waits_) add_odometry(to_stamp(action.timestamp), place, records);
  }

  void add_odometry(Stamp stamp, std::uint64_t place, std::vector<PlacedRecord>& records) {
    auto odometry = std::make_shared<mrpt::obs::CObservationOdometry>();
    odometry->sensorLabel = kOdometryLabel;
    odometry->timestamp = to_mrpt_time(stamp);
    odometry->odometry = mrpt::poses::CPose2D(odometry_from_robot_);
    records.push_back({{stamp, odometry}, place});
    odometry_waits_ = false;
  }

  std::unique_ptr<ByteSource> bytes_;
  SourceArchive archive_;
  std::uint64_t most_bytes_;
  std::filesystem::path images_;
  Pose2 odometry_from_robot_;
  bool odometry_waits_ = false;  // accumulated from an action without a stamp, for the next sensory frame
  std::map<std::string, std::uint64_t> others_;
};

}  // namespace

// The first bytes are an object's header: the length of a class name and that name.
bool is_rawlog(std::string_view start) {
  if (start.empty()) return false;
  const auto first = static_cast<unsigned char>(start.front());
  const std::size_t length = first & 0x7f, name_at = (first & 0x80) != 0 ? 1 : 4;
  if (name_at == 4 && start.substr(1, 3) != std::string_view("\0\0\0", 3)) return false;
  const auto name = start.substr(std::min(name_at, start.size()), length);
  return length > 1 && (name.substr(0, 1) == "C" || name.substr(0, 4) == "mrpt" || name == "nullptr") &&
         std::all_of(name.begin(), name.end(),
                     [](unsigned char c) { return std::isalnum(c) != 0 || c == ':' || c == '_'; });
}

std::unique_ptr<RecordSource> open_rawlog(std::unique_ptr<ByteSource> bytes, const ReadOptions& options) {
  return std::make_unique<RawlogReader>(std::move(bytes), options);
}

}  // namespace mapweave::rawlog
