#pragma once
// Points of cameras, from map.pcd.

#include <mapweave/core/geometry.h>

#include "encoding.h"

#include <cstdint>
#include <string>
#include <vector>

namespace mapweave::report {

struct ReportPoint {
  float place[3];  // metres, the map's frame
  std::uint32_t rgb;
};

// Of a PCD file as exporters/point_cloud.h writes it; points that are not finite are left out. Throws Error kCorrupt
// for another one.
std::vector<ReportPoint> parse_pcd(std::string_view bytes, const std::string& where);

// Walls of lasers alone lie in one plane.
bool is_in_space(const std::vector<ReportPoint>&);

struct PointBounds {
  double low_x, low_y, high_x, high_y;
};
// Where nearly all of them lie. Contract: there are some.
PointBounds bounds_of(const std::vector<ReportPoint>&);

// At most `most`, evenly picked: 8 bytes each, of 16 bits for x, y, z and a colour.
Json points_json(const std::vector<ReportPoint>&, std::size_t most, const std::string& file);
constexpr std::size_t kBytesOfPoint = 11;  // in the page

}  // namespace mapweave::report
