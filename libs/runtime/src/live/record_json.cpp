#include "record_json.h"

#include <cmath>

namespace mapweave::runtime {

using Json = nlohmann::json;
using scheduling::member;
using scheduling::refuse;

namespace {

constexpr double kMost = 1e15;
constexpr std::size_t kPoseNumbers = 7;  // t, q as x, y, z, w

Pose3 pose_from(const Json& list, std::size_t first, const std::string& where, const std::string& key) {
  constexpr double kUnit = 1e-6;
  double numbers[kPoseNumbers] = {};
  for (std::size_t i = 0; i < kPoseNumbers; ++i) numbers[i] = number_of(list[first + i], where, key);
  Pose3 pose;
  pose.t = {numbers[0], numbers[1], numbers[2]};
  pose.q = Eigen::Quaterniond(numbers[6], numbers[3], numbers[4], numbers[5]);
  if (std::abs(pose.q.norm() - 1.0) > kUnit) refuse("a rotation that is none", where, key, "");
  return pose;
}

}  // namespace

Json json_of(const Pose3& p) { return {p.t.x(), p.t.y(), p.t.z(), p.q.x(), p.q.y(), p.q.z(), p.q.w()}; }

Pose3 pose_of(const Json& json, const std::string& where, const std::string& key) {
  if (!json.is_array() || json.size() != kPoseNumbers) refuse("a pose is seven numbers", where, key, "");
  return pose_from(json, 0, where, key);
}

Json json_of(const std::vector<StampedPose>& poses) {
  Json list = Json::array();
  for (const StampedPose& pose : poses) {
    const Pose3& p = pose.map_from_robot;
    list.push_back({pose.stamp.ns, p.t.x(), p.t.y(), p.t.z(), p.q.x(), p.q.y(), p.q.z(), p.q.w()});
  }
  return list;
}

std::vector<StampedPose> poses_of(const Json& list, const std::string& where, const std::string& key) {
  std::vector<StampedPose> poses;
  poses.reserve(list_of(list, where, key).size());
  for (const Json& one : list) {
    if (!one.is_array() || one.size() != kPoseNumbers + 1)
      refuse("a pose is a stamp and seven numbers", where, key, "");
    StampedPose pose;
    pose.stamp.ns = whole_number_of(one[0], where, key);
    pose.map_from_robot = pose_from(one, 1, where, key);
    if (!poses.empty() && pose.stamp < poses.back().stamp) refuse("stamps run backwards", where, key, "");
    poses.push_back(pose);
  }
  return poses;
}

std::string text_of(const Json& value, const std::string& where, const std::string& key) {
  if (!value.is_string()) refuse("a text was expected", where, key, "");
  return value.get<std::string>();
}

std::vector<std::string> texts_of(const Json& list, const std::string& where, const std::string& key) {
  std::vector<std::string> texts;
  for (const Json& one : list_of(list, where, key)) texts.push_back(text_of(one, where, key));
  return texts;
}

const Json& list_of(const Json& value, const std::string& where, const std::string& key) {
  if (!value.is_array()) refuse("a list was expected", where, key, "");
  return value;
}

std::int64_t whole_number_of(const Json& value, const std::string& where, const std::string& key) {
  if (!value.is_number_integer()) refuse("a whole number was expected", where, key, "");
  return value.get<std::int64_t>();
}

double number_of(const Json& value, const std::string& where, const std::string& key) {
  return scheduling::number(value, -kMost, kMost, false, where, key);
}

Json json_of(const Error& error) {
  return {{"code", static_cast<int>(error.code())},
          {"problem", error.problem()},
          {"where", error.where()},
          {"remedy", error.remedy()}};
}

Error error_of(const Json& json, const std::string& where) {
  const std::string key = "trouble";
  if (!json.is_object()) refuse("an object was expected", where, key, "");
  const double code = scheduling::number(member(json, "code", where, key), 0.0,
                                         static_cast<double>(ErrorCode::kInternal), false, where, key + ".code");
  return Error(static_cast<ErrorCode>(static_cast<int>(code)), text_of(member(json, "problem", where, key), where, key),
               text_of(member(json, "where", where, key), where, key),
               text_of(member(json, "remedy", where, key), where, key));
}

Hash hash_of_hex(const std::string& hex, const std::string& where) {
  Hash hash;
  const std::string digits = "0123456789abcdef";
  if (hex.size() != 2 * hash.bytes.size() || hex.find_first_not_of(digits) != std::string::npos)
    refuse("a checksum was expected", where, "log_sha256", "");
  for (std::size_t i = 0; i < hash.bytes.size(); ++i)
    hash.bytes[i] = static_cast<std::uint8_t>(16 * digits.find(hex[2 * i]) + digits.find(hex[2 * i + 1]));
  return hash;
}

}  // namespace mapweave::runtime
