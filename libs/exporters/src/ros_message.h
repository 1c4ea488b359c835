#pragma once
// Messages of ROS, as both generations serialize them.

#include <mapweave/core/geometry.h>
#include <mapweave/core/little_endian.h>
#include <mapweave/core/stamp.h>

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace mapweave::exporters {

enum class RosGeneration { ros1, ros2 };
enum class RosType { occupancy_grid, path, transforms, point_cloud };

// The type's full name in ROS 1; of ROS 2 with "/msg/".
std::string ros_type_name(RosType type, RosGeneration generation);
// The text of a message and all that it is made of, as bags hold it.
std::string ros_definition(RosType type, RosGeneration generation);
const char* ros1_md5(RosType type);

// The fields of a message, one after the other. ROS 1 packs them; CDR has four bytes in front, and each number at a
// multiple of its size.
class RosMessageWriter {
 public:
  explicit RosMessageWriter(RosGeneration generation) : generation_(generation) {
    if (generation == RosGeneration::ros2) bytes_.assign("\0\1\0\0", kEncapsulationBytes);
  }
  template <class Number>
  RosMessageWriter& put(Number number) {
    if (generation_ == RosGeneration::ros2)
      bytes_.resize((bytes_.size() - kEncapsulationBytes + sizeof number - 1) / sizeof number * sizeof number +
                    kEncapsulationBytes);
    append_number(bytes_, number);
    return *this;
  }
  RosMessageWriter& put_text(std::string_view text);
  RosMessageWriter& put_count(std::size_t count) { return put(static_cast<std::uint32_t>(count)); }
  RosMessageWriter& put_bytes(std::string_view bytes);  // a sequence of bytes
  RosMessageWriter& put_time(Stamp stamp);
  RosMessageWriter& put_header(Stamp stamp, std::string_view frame);
  RosMessageWriter& put_pose(const Pose3& pose);  // position or translation, then the quaternion
  std::string take() { return std::move(bytes_); }

 private:
  static constexpr std::size_t kEncapsulationBytes = 4;
  RosGeneration generation_;
  std::string bytes_;
};

// What is recorded.
struct RosTopic {
  std::string name;
  RosType type;
  bool latched;  // one message for all who come later
};
struct RosMessage {
  std::size_t topic;
  std::int64_t time_ns;
  std::string bytes;
};
struct RosRecording {
  std::vector<RosTopic> topics;
  std::vector<RosMessage> messages;  // by time
};

std::string ros1_bag_of(const RosRecording&);
std::string mcap_of(const RosRecording&);  // of ROS 2

}  // namespace mapweave::exporters
