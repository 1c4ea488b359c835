#include "ros_message.h"

#include <map>

namespace mapweave::exporters {
namespace {

struct Definition {
  const char* name;
  const char* fields;
  std::vector<const char*> parts;  // all types that it is made of, beside Header and Time
};

const char* fields_of(const std::string& type) {
  static const std::map<std::string, const char*> all = {
      {"builtin_interfaces/Time", "int32 sec\nuint32 nanosec\n"},
      {"nav_msgs/MapMetaData",
       "TIME map_load_time\nfloat32 resolution\nuint32 width\nuint32 height\ngeometry_msgs/Pose origin\n"},
      {"geometry_msgs/Pose", "geometry_msgs/Point position\ngeometry_msgs/Quaternion orientation\n"},
      {"geometry_msgs/Point", "float64 x\nfloat64 y\nfloat64 z\n"},
      {"geometry_msgs/Vector3", "float64 x\nfloat64 y\nfloat64 z\n"},
      {"geometry_msgs/Quaternion", "float64 x\nfloat64 y\nfloat64 z\nfloat64 w\n"},
      {"geometry_msgs/PoseStamped", "std_msgs/Header header\ngeometry_msgs/Pose pose\n"},
      {"geometry_msgs/Transform", "geometry_msgs/Vector3 translation\ngeometry_msgs/Quaternion rotation\n"},
      {"geometry_msgs/TransformStamped",
       "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/Transform transform\n"},
      {"sensor_msgs/PointField",
       "uint8 INT8=1\nuint8 UINT8=2\nuint8 INT16=3\nuint8 UINT16=4\nuint8 INT32=5\nuint8 UINT32=6\nuint8 "
       "FLOAT32=7\nuint8 FLOAT64=8\nstring name\nuint32 offset\nuint8 datatype\nuint32 count\n"},
  };
  return all.at(type);
}

const Definition& definition_of(RosType type) {
  static const Definition grid = {
      "nav_msgs/OccupancyGrid",
      "std_msgs/Header header\nnav_msgs/MapMetaData info\nint8[] data\n",
      {"nav_msgs/MapMetaData", "geometry_msgs/Pose", "geometry_msgs/Point", "geometry_msgs/Quaternion"}};
  static const Definition path = {
      "nav_msgs/Path",
      "std_msgs/Header header\ngeometry_msgs/PoseStamped[] poses\n",
      {"geometry_msgs/PoseStamped", "geometry_msgs/Pose", "geometry_msgs/Point", "geometry_msgs/Quaternion"}};
  static const Definition transforms = {"tf2_msgs/TFMessage",
                                        "geometry_msgs/TransformStamped[] transforms\n",
                                        {"geometry_msgs/TransformStamped", "geometry_msgs/Transform",
                                         "geometry_msgs/Vector3", "geometry_msgs/Quaternion"}};
  static const Definition cloud = {"sensor_msgs/PointCloud2",
                                   "std_msgs/Header header\nuint32 height\nuint32 width\nsensor_msgs/PointField[] "
                                   "fields\nbool is_bigendian\nuint32 point_step\nuint32 row_step\nuint8[] data\nbool "
                                   "is_dense\n",
                                   {"sensor_msgs/PointField"}};
  switch (type) {
    case RosType::occupancy_grid: return grid;
    case RosType::path: return path;
    case RosType::transforms: return transforms;
    case RosType::point_cloud: break;
  }
  return cloud;
}

std::string with_time(std::string fields, RosGeneration generation) {
  const std::string time = generation == RosGeneration::ros1 ? "time" : "builtin_interfaces/Time";
  if (fields.compare(0, 4, "TIME") == 0) fields.replace(0, 4, time);
  return fields;
}

}  // namespace

std::string ros_type_name(RosType type, RosGeneration generation) {
  std::string name = definition_of(type).name;
  if (generation == RosGeneration::ros2) name.insert(name.find('/'), "/msg");
  return name;
}

std::string ros_definition(RosType type, RosGeneration generation) {
  const Definition& definition = definition_of(type);
  std::string text = definition.fields;
  const auto add = [&](const std::string& name, const std::string& fields) {
    text += std::string(80, '=') + "\nMSG: " + name + "\n" + fields;
  };
  const bool is_ros1 = generation == RosGeneration::ros1;
  add("std_msgs/Header",
      is_ros1 ? "uint32 seq\ntime stamp\nstring frame_id\n" : "builtin_interfaces/Time stamp\nstring frame_id\n");
  if (!is_ros1) add("builtin_interfaces/Time", fields_of("builtin_interfaces/Time"));
  for (const char* part : definition.parts) add(part, with_time(fields_of(part), generation));
  return text;
}

const char* ros1_md5(RosType type) {
  switch (type) {
    case RosType::occupancy_grid: return "3381f2d731d4076ec5c71b0759edbe4e";
    case RosType::path: return "6227e2b7e9cce15051f669a5e197bbf7";
    case RosType::transforms: return "94810edda583a504dfda3829e70d7eec";
    case RosType::point_cloud: break;
  }
  return "1158d486dd51d683ce2f1be655c3c181";
}

RosMessageWriter& RosMessageWriter::put_text(std::string_view text) {
  const bool has_end = generation_ == RosGeneration::ros2;
  put_count(text.size() + (has_end ? 1 : 0));
  bytes_ += text;
  if (has_end) bytes_ += '\0';
  return *this;
}

RosMessageWriter& RosMessageWriter::put_bytes(std::string_view bytes) {
  put_count(bytes.size());
  bytes_ += bytes;
  return *this;
}

RosMessageWriter& RosMessageWriter::put_time(Stamp stamp) {
  constexpr std::int64_t kNanoseconds = 1'000'000'000;
  // Of stamps from 1970 on, of which the signed seconds of ROS 2 have the same bits.
  return put(static_cast<std::uint32_t>(stamp.ns / kNanoseconds))
      .put(static_cast<std::uint32_t>(stamp.ns % kNanoseconds));
}

RosMessageWriter& RosMessageWriter::put_header(Stamp stamp, std::string_view frame) {
  if (generation_ == RosGeneration::ros1) put(std::uint32_t{0});  // seq
  return put_time(stamp).put_text(frame);
}

RosMessageWriter& RosMessageWriter::put_pose(const Pose3& pose) {
  put(pose.t.x()).put(pose.t.y()).put(pose.t.z());
  return put(pose.q.x()).put(pose.q.y()).put(pose.q.z()).put(pose.q.w());
}

}  // namespace mapweave::exporters
