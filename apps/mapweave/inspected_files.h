#pragma once
// What is in the files that stand beside maps: trajectories, graphs, clouds, pictures, configurations, words.

#include <nlohmann/json.hpp>

#include <filesystem>
#include <optional>

namespace mapweave::app {

// By the file's ending and beginning; nullopt for what is none of these. Throws what reading throws.
std::optional<nlohmann::ordered_json> contents_of_file(const std::filesystem::path&);

}  // namespace mapweave::app
