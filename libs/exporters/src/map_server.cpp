#include <mapweave/exporters/map_server.h>

#include "grey_image.h"
#include "number_text.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/core/geometry.h>
#include <mapweave/core/log.h>
#include <yaml-cpp/yaml.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <set>

namespace mapweave::exporters {
namespace {

constexpr double kOccupiedThreshold = 0.65, kFreeThreshold = 0.196;
constexpr double kFarthestOriginM = 1e7;  // keeps the numbers of cells within 64 bits

enum class Mode { trinary, scale, raw };

struct Description {
  std::filesystem::path image;
  int image_line = 0;
  double resolution_m = 0.0, occupied_threshold = kOccupiedThreshold, free_threshold = kFreeThreshold;
  std::array<double, 3> origin{};  // x, y, yaw of the lower-left corner
  bool negate = false;
  Mode mode = Mode::trinary;
  std::map<std::string, std::string> identity;  // map_id, map_version, content_hash, where they are there
};

class DescriptionReader {
 public:
  explicit DescriptionReader(const std::filesystem::path& file) : file_(file) {}

  Description read() {
    try {
      root_ = YAML::Load(read_file(file_, 1 << 20));
      if (!root_.IsMap())
        fail(ErrorCode::kBadInput, root_,
             "this is no map's description; expected keys like 'image: map.pgm' and 'resolution: 0.05'",
             "give the YAML file of a map, not its image");
      return described();
    } catch (const YAML::Exception& error) {
      throw Error(ErrorCode::kBadInput, "no valid YAML: " + error.msg,
                  file_.string() + ":" + std::to_string(error.mark.line + 1));
    }
  }

 private:
  [[noreturn]] void fail(ErrorCode code, const YAML::Node& node, const std::string& what,
                         const std::string& remedy = {}) const {
    throw Error(code, what, file_.string() + ":" + std::to_string(node.Mark().line + 1), remedy);
  }

  Description described() const {
    static const std::array<const char*, 10> kKeys = {
        "image",           "mode",        "resolution", "origin",      "negate",
        "occupied_thresh", "free_thresh", "map_id",     "map_version", "content_hash"};  // the last three are ours
    std::set<std::string> seen;
    for (const auto& entry : root_) {
      const std::string key = entry.first.IsScalar() ? entry.first.Scalar() : "";
      if (!seen.insert(key).second)
        fail(ErrorCode::kBadInput, entry.first, "the key '" + key + "' comes twice", "remove one of them");
      if (std::find(kKeys.begin(), kKeys.end(), key) == kKeys.end())
        log(LogLevel::warning, file_.string() + ":" + std::to_string(entry.first.Mark().line + 1) + ": the key '" +
                                   key + "' is not map_server's and is passed over");
    }
    Description result;
    const YAML::Node image = required("image");
    if (!image.IsScalar() || image.Scalar().empty() || image.Scalar().find('\0') != std::string::npos)
      fail(ErrorCode::kBadInput, image, "'image' must be a file's name");
    result.image = file_.parent_path() / image.Scalar();
    result.image_line = image.Mark().line + 1;
    result.resolution_m = number(required("resolution"), "resolution", 1e-4, 1e3, "metres per pixel");
    if (const YAML::Node origin = root_["origin"]) {
      if (!origin.IsSequence() || origin.size() != 3)
        fail(ErrorCode::kBadInput, origin, "'origin' must be three numbers, [x, y, yaw] of the lower-left pixel",
             "give 0 for a map that is not turned");
      for (std::size_t i = 0; i < origin.size(); ++i)
        result.origin[i] =
            number(origin[i], "origin", -kFarthestOriginM, kFarthestOriginM, i == 2 ? "radians" : "metres");
    }
    if (const YAML::Node negate = root_["negate"]) result.negate = yes_or_no(negate);
    if (const YAML::Node threshold = root_["occupied_thresh"])
      result.occupied_threshold = number(threshold, "occupied_thresh", 0.0, 1.0, "a share");
    if (const YAML::Node threshold = root_["free_thresh"])
      result.free_threshold = number(threshold, "free_thresh", 0.0, 1.0, "a share");
    if (result.free_threshold >= result.occupied_threshold)
      fail(ErrorCode::kBadInput, root_, "'free_thresh' must be below 'occupied_thresh'",
           "leave both out for 0.196 and 0.65");
    for (const char* key : {"map_id", "map_version", "content_hash"})
      if (const YAML::Node node = root_[key]; node && node.IsScalar()) result.identity[key] = node.Scalar();
    if (const YAML::Node mode = root_["mode"]) {
      const std::string text = mode.IsScalar() ? mode.Scalar() : "";
      if (text != "trinary" && text != "scale" && text != "raw")
        fail(ErrorCode::kBadInput, mode, "'mode' is '" + text + "'; it must be trinary, scale or raw");
      result.mode = text == "trinary" ? Mode::trinary : text == "scale" ? Mode::scale : Mode::raw;
    }
    return result;
  }

  YAML::Node required(const std::string& key) const {
    const YAML::Node node = root_[key];
    if (!node)
      fail(ErrorCode::kMissing, root_, "the key '" + key + "' is missing",
           "a map's description has at least 'image' and 'resolution'");
    return node;
  }

  double number(const YAML::Node& node, const std::string& key, double low, double high,
                const std::string& unit) const {
    double value = NAN;
    if (!node.IsScalar() || !YAML::convert<double>::decode(node, value))
      fail(ErrorCode::kBadInput, node,
           "'" + key + "' must be a number (" + unit + ")" + (node.IsScalar() ? ", not '" + node.Scalar() + "'" : ""));
    if (!(value >= low && value <= high)) {
      std::string range;
      append_shortest(range, low);
      range += "..";
      append_shortest(range, high);
      fail(ErrorCode::kBadInput, node,
           "'" + key + "' is " + node.Scalar() + "; it must lie in " + range + " (" + unit + ")");
    }
    return value;
  }

  // ROS writes 0 or 1, people true or false.
  bool yes_or_no(const YAML::Node& node) const {
    bool value = false;
    if (node.IsScalar() && (node.Scalar() == "0" || node.Scalar() == "1")) return node.Scalar() == "1";
    if (!node.IsScalar() || !YAML::convert<bool>::decode(node, value))
      fail(ErrorCode::kBadInput, node, "'negate' must be 0 or 1");
    return value;
  }

  std::filesystem::path file_;
  YAML::Node root_;
};

std::int16_t log_odds_of(double share) {
  const double nats = std::log(std::max(share, 1e-9) / std::max(1.0 - share, 1e-9));
  return static_cast<std::int16_t>(std::clamp(std::lround(nats * OccupancyGrid::kUnitsPerNat),
                                              -static_cast<long>(kServedLogOdds), static_cast<long>(kServedLogOdds)));
}

// Log odds of each shade, as nav2 reads it.
std::array<std::int16_t, 256> log_odds_of_shades(const Description& description) {
  std::array<std::int16_t, 256> table{};
  for (int shade = 0; shade < 256; ++shade) {
    std::int16_t& log_odds = table[static_cast<std::size_t>(shade)];
    if (description.mode == Mode::raw) {
      log_odds = shade <= 100 ? log_odds_of(shade / 100.0) : OccupancyGrid::kUnknown;
      continue;
    }
    const double occupied = (description.negate ? shade : 255 - shade) / 255.0;
    if (occupied > description.occupied_threshold)
      log_odds = kServedLogOdds;
    else if (occupied < description.free_threshold)
      log_odds = static_cast<std::int16_t>(-kServedLogOdds);
    else if (description.mode == Mode::scale)
      log_odds = log_odds_of(0.01 + 0.98 * (occupied - description.free_threshold) /
                                        (description.occupied_threshold - description.free_threshold));
  }
  return table;
}

// Along the axes of the map. `grid` has its lower-left corner at its own origin (0, 0), which stands at
// `map_from_grid`.
OccupancyGrid resampled(const OccupancyGrid& grid, const Pose2& map_from_grid, const std::string& where) {
  const double width_m = grid.columns * grid.resolution_m, height_m = grid.rows * grid.resolution_m;
  double low_x = INFINITY, low_y = INFINITY, high_x = -INFINITY, high_y = -INFINITY;
  for (const auto& [x, y] :
       {std::pair(0.0, 0.0), std::pair(width_m, 0.0), std::pair(0.0, height_m), std::pair(width_m, height_m)}) {
    const Pose2 corner = compose(map_from_grid, Pose2(x, y, 0.0));
    low_x = std::min(low_x, corner.x);
    high_x = std::max(high_x, corner.x);
    low_y = std::min(low_y, corner.y);
    high_y = std::max(high_y, corner.y);
  }
  OccupancyGrid result;
  result.resolution_m = grid.resolution_m;
  result.origin_x_m = low_x;
  result.origin_y_m = low_y;
  const double columns = std::ceil((high_x - low_x) / grid.resolution_m - 1e-6),
               rows = std::ceil((high_y - low_y) / grid.resolution_m - 1e-6);
  if (columns * rows > 4e8)
    throw Error(ErrorCode::kUnsupported, "turned by its yaw, the map has too many cells", where,
                "turn the image in an image editor and set the yaw to 0");
  result.columns = static_cast<std::int32_t>(columns);
  result.rows = static_cast<std::int32_t>(rows);
  result.log_odds.reserve(static_cast<std::size_t>(result.columns) * static_cast<std::size_t>(result.rows));
  const Pose2 grid_from_map = inverse(map_from_grid);
  for (std::int32_t row = 0; row < result.rows; ++row)
    for (std::int32_t column = 0; column < result.columns; ++column) {
      const Pose2 centre = compose(grid_from_map, Pose2(low_x + (column + 0.5) * grid.resolution_m,
                                                        low_y + (row + 0.5) * grid.resolution_m, 0.0));
      const auto from_column = static_cast<std::int32_t>(std::floor(centre.x / grid.resolution_m)),
                 from_row = static_cast<std::int32_t>(std::floor(centre.y / grid.resolution_m));
      result.log_odds.push_back(grid.inside(from_column, from_row) ? grid.at(from_column, from_row)
                                                                   : OccupancyGrid::kUnknown);
    }
  return result;
}

}  // namespace

std::string pgm_bytes(const OccupancyGrid& grid) {
  const MapServerImage image = grey_image(grid);
  std::string bytes = "P5\n" + std::to_string(image.columns) + " " + std::to_string(image.rows) + "\n255\n";
  bytes.append(image.shades.begin(), image.shades.end());
  return bytes;
}

std::string map_server_yaml(const OccupancyGrid& grid, const std::string& image_name, const MapIdentity& identity) {
  std::string text = "image: " + image_name + "\nmode: trinary\nresolution: ";
  append_shortest(text, grid.resolution_m);
  text += "\norigin: [";
  append_shortest(text, grid.origin_x_m);
  text += ", ";
  append_shortest(text, grid.origin_y_m);
  text += ", 0]\nnegate: 0\noccupied_thresh: ";
  append_shortest(text, kOccupiedThreshold);
  text += "\nfree_thresh: ";
  append_shortest(text, kFreeThreshold);
  text += "\n";
  if (identity.version > 0)
    text += "map_id: \"" + identity.id + "\"\nmap_version: \"" + std::to_string(identity.version) +
            "\"\ncontent_hash: \"" + to_hex(identity.content) + "\"\n";
  return text;
}

void write_map_server(const OccupancyGrid& grid, const std::filesystem::path& folder, const std::string& stem,
                      const MapIdentity& identity) {
  write_file(folder / (stem + ".pgm"), pgm_bytes(grid));
  write_file(folder / (stem + ".yaml"), map_server_yaml(grid, stem + ".pgm", identity));
}

std::filesystem::path image_of_map_server(const std::filesystem::path& yaml_file) {
  return DescriptionReader(yaml_file).read().image;
}

std::map<std::string, std::string> identity_of_map_server(const std::filesystem::path& yaml_file) {
  return DescriptionReader(yaml_file).read().identity;
}

OccupancyGrid read_map_server(const std::filesystem::path& yaml_file) {
  const Description description = DescriptionReader(yaml_file).read();
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(description.image, ignored))
    throw Error(ErrorCode::kMissing, "the image '" + description.image.string() + "' is not there",
                yaml_file.string() + ":" + std::to_string(description.image_line),
                "put it beside the YAML file, or correct the key 'image'");
  const MapServerImage image =
      decode_image(read_file(description.image, std::uint64_t{1} << 30), description.image.string());

  OccupancyGrid grid;
  grid.resolution_m = description.resolution_m;
  grid.columns = image.columns;
  grid.rows = image.rows;
  grid.log_odds.reserve(image.shades.size());
  const auto table = log_odds_of_shades(description);
  for (std::int32_t row = image.rows - 1; row >= 0; --row)
    for (std::int32_t column = 0; column < image.columns; ++column) {
      const auto pixel =
          static_cast<std::size_t>(row) * static_cast<std::size_t>(image.columns) + static_cast<std::size_t>(column);
      const bool hidden = description.mode == Mode::scale && !image.transparent.empty() && image.transparent[pixel];
      grid.log_odds.push_back(hidden ? OccupancyGrid::kUnknown : table[image.shades[pixel]]);
    }
  const Pose2 map_from_grid(description.origin[0], description.origin[1], wrap_angle(description.origin[2]));
  if (map_from_grid.phi != 0.0) return resampled(grid, map_from_grid, yaml_file.string());
  grid.origin_x_m = map_from_grid.x;
  grid.origin_y_m = map_from_grid.y;
  return grid;
}

}  // namespace mapweave::exporters
