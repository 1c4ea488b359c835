#include "exchange_form.h"

#include <mapweave/maps/mapper_messages.h>

#include <cmath>

namespace mapweave {
namespace {

constexpr int kNumbers = 6;  // a scan

std::string encoded(const EngineStart& start) {
  form::Exchange form;
  auto& content = *form.mutable_engine_start();
  content.set_engine(start.engine);
  for (const EngineStart::Option& option : start.options) {
    MAPWEAVE_EXPECT(std::isfinite(option.value), "an option is a number");
    auto& line = *content.add_options();
    line.set_name(option.name);
    line.set_value(option.value);
  }
  return written(form);
}

std::string encoded(const MapperProgress& progress) {
  form::Exchange form;
  form.mutable_mapper_progress()->set_scans(progress.scans);
  return written(form);
}

std::string encoded(const ScanPoses& all) {
  form::Exchange form;
  auto& content = *form.mutable_scan_poses();
  for (const ScanPose& scan : all.poses) {
    for (const Pose2& pose : {scan.map_from_robot, scan.previous_from_this}) {
      MAPWEAVE_EXPECT(is_finite(pose), "a pose is finite");
      content.add_numbers(pose.x);
      content.add_numbers(pose.y);
      content.add_numbers(pose.phi);
    }
    content.add_by_wheels(scan.by_wheels);
  }
  content.set_is_last(all.is_last);
  return written(form);
}

EngineStart start_of(const form::EngineStart& content, const FormReader& reader) {
  EngineStart start{content.engine(), {}};
  for (const auto& line : content.options()) {
    if (!std::isfinite(line.value())) reader.corrupt("an option is not finite");
    start.options.push_back({line.name(), line.value()});
  }
  return start;
}

ScanPoses poses_of(const form::ScanPoses& content, const FormReader& reader) {
  if (content.numbers_size() != kNumbers * content.by_wheels_size())
    reader.corrupt(std::to_string(content.numbers_size()) + " numbers of " + std::to_string(content.by_wheels_size()) +
                   " scans; six each are expected");
  ScanPoses all{{}, content.is_last()};
  all.poses.reserve(static_cast<std::size_t>(content.by_wheels_size()));
  for (int scan = 0; scan < content.by_wheels_size(); ++scan) {
    const double* const at = content.numbers().data() + kNumbers * scan;
    all.poses.push_back({{at[0], at[1], at[2]}, {at[3], at[4], at[5]}, content.by_wheels(scan)});
    if (!is_finite(all.poses.back().map_from_robot) || !is_finite(all.poses.back().previous_from_this))
      reader.corrupt("a pose is not finite");
  }
  return all;
}

}  // namespace

std::string encode(const MapperInput& input) {
  if (const auto* start = std::get_if<EngineStart>(&input)) return encoded(*start);
  if (const auto* sensed = std::get_if<Sensed>(&input)) return encode(*sensed);
  form::Exchange form;
  form.mutable_poses_wanted();
  return written(form);
}

std::string encode(const MapperOutput& output) {
  if (const auto* progress = std::get_if<MapperProgress>(&output)) return encoded(*progress);
  if (const auto* poses = std::get_if<ScanPoses>(&output)) return encoded(*poses);
  return encode(std::get<Refusal>(output));
}

MapperInput decode_mapper_input(std::string_view bytes, const std::string& where) {
  FormReader reader(where);
  const auto form = read_exchange(bytes, reader, where, std::nullopt);
  switch (form.content_case()) {
    case form::Exchange::kEngineStart: return start_of(form.engine_start(), reader);
    case form::Exchange::kSensed: return sensed_of(form.sensed(), reader);
    case form::Exchange::kPosesWanted: return PosesWanted{};
    default: reader.corrupt("it is no message for a helper");
  }
}

MapperOutput decode_mapper_output(std::string_view bytes, const std::string& where) {
  FormReader reader(where);
  const auto form = read_exchange(bytes, reader, where, std::nullopt);
  switch (form.content_case()) {
    case form::Exchange::kMapperProgress: return MapperProgress{form.mapper_progress().scans()};
    case form::Exchange::kScanPoses: return poses_of(form.scan_poses(), reader);
    case form::Exchange::kRefusal: return Refusal{error_of(form.refusal(), reader)};
    default: reader.corrupt("it is no message of a helper");
  }
}

}  // namespace mapweave
