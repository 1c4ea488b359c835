#pragma once
// Pictures that lie in a folder beside a log.

#include <mrpt/obs/CObservation.h>

#include <filesystem>

namespace mapweave::rawlog {

// Where the pictures of a log lie: NAME_Images beside it, or the log's own folder where that is missing.
std::filesystem::path images_folder(const std::filesystem::path& log);

// Makes the paths of pictures outside the log absolute, so that MRPT's process-wide base path is not needed.
void make_image_paths_absolute(mrpt::obs::CObservation& observation, const std::filesystem::path& folder);

}  // namespace mapweave::rawlog
