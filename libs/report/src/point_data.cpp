#include "point_data.h"

#include <mapweave/core/error.h>

#include <algorithm>
#include <cmath>
#include <cstring>

namespace mapweave::report {
namespace {

// What stands behind a word of the header, up to the end of its line.
std::string value_of(std::string_view header, const std::string& word) {
  const std::size_t begin = header.find("\n" + word + " ");
  if (begin == std::string_view::npos) return {};
  const std::size_t from = begin + word.size() + 2;
  return std::string(header.substr(from, header.find('\n', from) - from));
}

// The value that `share` of the points lie below.
double quantile(std::vector<float>& values, double share) {
  const auto place = static_cast<std::ptrdiff_t>(share * static_cast<double>(values.size() - 1));
  std::nth_element(values.begin(), values.begin() + place, values.end());
  return values[static_cast<std::size_t>(place)];
}

}  // namespace

std::vector<ReportPoint> parse_pcd(std::string_view bytes, const std::string& where) {
  constexpr std::string_view kEnd = "\nDATA binary\n";
  static_assert(sizeof(ReportPoint) == 16);
  const std::size_t end = bytes.find(kEnd);
  if (end == std::string_view::npos || value_of(bytes.substr(0, end + 1), "FIELDS") != "x y z rgb" ||
      value_of(bytes.substr(0, end + 1), "SIZE") != "4 4 4 4")
    throw Error(ErrorCode::kCorrupt, "it is no cloud of coloured points as mapweave writes it", where);
  const std::string_view data = bytes.substr(end + kEnd.size());
  std::vector<ReportPoint> points(data.size() / sizeof(ReportPoint));
  if (!points.empty()) std::memcpy(points.data(), data.data(), points.size() * sizeof(ReportPoint));
  points.erase(std::remove_if(points.begin(), points.end(),
                              [](const ReportPoint& point) {
                                return !std::all_of(point.place, point.place + 3,
                                                    [](float value) { return std::abs(value) < 1e6f; });
                              }),
               points.end());
  return points;
}

bool is_in_space(const std::vector<ReportPoint>& points) {
  constexpr float kFlat_m = 0.01f;
  return std::any_of(points.begin(), points.end(),
                     [](const ReportPoint& point) { return std::abs(point.place[2]) > kFlat_m; });
}

PointBounds bounds_of(const std::vector<ReportPoint>& points) {
  constexpr double kLeftOut = 0.005;
  double low[2], high[2];
  for (const int axis : {0, 1}) {
    std::vector<float> values;
    values.reserve(points.size());
    for (const ReportPoint& point : points) values.push_back(point.place[axis]);
    low[axis] = quantile(values, kLeftOut);
    high[axis] = quantile(values, 1.0 - kLeftOut);
  }
  return {low[0], low[1], high[0], high[1]};
}

Json points_json(const std::vector<ReportPoint>& points, std::size_t most, const std::string& file) {
  // Outliers far away would make the steps of 16 bits coarse: they are moved to the border.
  constexpr double kLeftOut = 0.002, kSteps = 65535.0;
  double low[3] = {}, step[3] = {};
  for (int axis = 0; axis < 3 && !points.empty(); ++axis) {
    std::vector<float> values;
    for (const ReportPoint& point : points) values.push_back(point.place[axis]);
    low[axis] = quantile(values, kLeftOut);
    step[axis] = std::max(1e-6, (quantile(values, 1.0 - kLeftOut) - low[axis]) / kSteps);
  }
  const std::size_t count = std::min(points.size(), most);
  std::string bytes;
  const auto put = [&](std::uint32_t value) {
    bytes += static_cast<char>(value & 255u);
    bytes += static_cast<char>(value >> 8 & 255u);
  };
  for (std::size_t i = 0; i < count; ++i) {
    const ReportPoint& point = points[i * points.size() / count];
    for (int axis = 0; axis < 3; ++axis)
      put(static_cast<std::uint32_t>(
          std::lround(std::clamp((point.place[axis] - low[axis]) / step[axis], 0.0, kSteps))));
    put((point.rgb >> 19 & 31u) << 11 | (point.rgb >> 10 & 63u) << 5 | (point.rgb >> 3 & 31u));
  }
  return {{"file", file},         {"total", points.size()},          {"count", count},
          {"is_in_space", true},  {"low", {low[0], low[1], low[2]}}, {"step", {step[0], step[1], step[2]}},
          {"data", base64(bytes)}};
}

}  // namespace mapweave::report
