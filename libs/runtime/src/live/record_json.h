#pragma once
// Values of reports on robots as JSON. What is read throws Error kBadInput, naming where and key.

#include <mapweave/core/error.h>
#include <mapweave/core/hash.h>
#include <mapweave/core/stamped_pose.h>
#include <mapweave/scheduling/json_fields.h>

#include <nlohmann/json.hpp>

#include <string>
#include <vector>

namespace mapweave::runtime {

nlohmann::json json_of(const Pose3& pose);
Pose3 pose_of(const nlohmann::json& json, const std::string& where, const std::string& key);
// By stamp.
nlohmann::json json_of(const std::vector<StampedPose>& poses);
std::vector<StampedPose> poses_of(const nlohmann::json& list, const std::string& where, const std::string& key);
nlohmann::json json_of(const Error& error);
Error error_of(const nlohmann::json& json, const std::string& where);
Hash hash_of_hex(const std::string& hex, const std::string& where);
std::string text_of(const nlohmann::json& value, const std::string& where, const std::string& key);
std::vector<std::string> texts_of(const nlohmann::json& list, const std::string& where, const std::string& key);
const nlohmann::json& list_of(const nlohmann::json& value, const std::string& where, const std::string& key);
std::int64_t whole_number_of(const nlohmann::json& value, const std::string& where, const std::string& key);
double number_of(const nlohmann::json& value, const std::string& where, const std::string& key);

}  // namespace mapweave::runtime
