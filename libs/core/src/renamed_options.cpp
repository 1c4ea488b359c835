#include <mapweave/core/renamed_options.h>

#include <algorithm>
#include <iterator>

namespace mapweave {
namespace {

struct RenamedOption {
  std::string_view section, before, now;
};
constexpr RenamedOption kRenamed[] = {
    {"", "bind", "laser_camera_alignment"},
    {"laser_camera_alignment", "tie_m", "extrinsic_sigma_m"},
    {"laser_camera_alignment", "tie_rad", "extrinsic_sigma_rad"},
    {"laser_camera_alignment", "step_m", "covisibility_sigma_m"},
    {"laser_camera_alignment", "step_share", "covisibility_sigma_per_m"},
    {"laser_camera_alignment", "step_rad", "covisibility_sigma_rad"},
    {"rig", "tie_m", "extrinsic_sigma_m"},
    {"rig", "tie_rad", "extrinsic_sigma_rad"},
    {"rig", "step_m", "covisibility_sigma_m"},
    {"rig", "step_share", "covisibility_sigma_per_m"},
    {"rig", "step_rad", "covisibility_sigma_rad"},
    {"rig", "step_scale", "covisibility_sigma_scale"},
    {"rig", "way", "trajectory"},
    {"fusion.visual", "companions", "covisible"},
    {"visual.loops", "witnesses", "agreeing_keyframes"},
    {"live", "map_server", "camera_map_server"},
};

}  // namespace

std::optional<std::string_view> present_name(std::string_view section, std::string_view name) {
  const auto found = std::find_if(std::begin(kRenamed), std::end(kRenamed), [&](const RenamedOption& renamed) {
    return renamed.section == section && renamed.before == name;
  });
  return found == std::end(kRenamed) ? std::nullopt : std::optional(found->now);
}

std::string present_key(std::string_view key) {
  std::string present;
  for (std::size_t begin = 0; begin <= key.size();) {
    const std::size_t end = std::min(key.find('.', begin), key.size());
    const std::string_view name = key.substr(begin, end - begin);
    const std::string now(present_name(present, name).value_or(name));
    present += (present.empty() ? "" : ".") + now;
    begin = end + 1;
  }
  return present;
}

}  // namespace mapweave
