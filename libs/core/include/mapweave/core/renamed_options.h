#pragma once
// Options that were called otherwise in an earlier version. load() takes their old keys as the present ones in this
// version, and a warning in the log names the present key.

#include <optional>
#include <string>
#include <string_view>

namespace mapweave {

// What the option or section `name` of a section is called now; nullopt where it was not renamed. `section`: its
// present key.
std::optional<std::string_view> present_name(std::string_view section, std::string_view name);

// The same of a whole key: bind.tie_m -> laser_camera_alignment.extrinsic_sigma_m. Other keys come back as they are.
std::string present_key(std::string_view key);

}  // namespace mapweave
