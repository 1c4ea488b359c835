#pragma once
// What a robot's cameras left, for the folder of results, as JSON: all but the maps, of which the ids stand there.

#include <mapweave/runtime/camera_task.h>

#include <nlohmann/json.hpp>

#include <string>

namespace mapweave::runtime {

nlohmann::json json_of(const CamerasOutcome& cameras);
// Throws Error kBadInput for what is not sound. Whose cameras they are and what went wrong stands elsewhere.
CamerasOutcome cameras_of(const nlohmann::json& json, const std::string& where);

}  // namespace mapweave::runtime
