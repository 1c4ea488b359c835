#include "exchange_form.h"

namespace mapweave {
namespace {

// 1 knows no dense points, 2 nothing sensed, 3 no reports, 4 no sweeps and no inertial units, 5 nothing of tiers but
// reports, 6 no floats, 7 no keyframes that are shared, 8 no scans that are lost and no report at the end of a stream,
// 9 no robots that map on board.
constexpr std::uint32_t kVersion = 10, kEndVersion = 9, kSharedVersion = 8, kFloatVersion = 7, kTierVersion = 6,
                        kSweepVersion = 5, kReportVersion = 4, kSensedVersion = 3, kDenseVersion = 2;
constexpr std::size_t kMostBytes = std::size_t{16} << 20;
constexpr std::size_t kMostMergedBytes = std::size_t{1} << 30;  // of what holds the constraints of a team, as an update

std::uint32_t version_of(const form::Exchange& form) {
  switch (form.content_case()) {
    case form::Exchange::kHello:
    case form::Exchange::kPlaceAnswer: return 1;
    case form::Exchange::kView: return form.view().room() == 0 ? 1 : kSharedVersion;
    case form::Exchange::kShare:
      return form.share().keyframes().empty() && form.share().dropped().empty() ? 1 : kSharedVersion;
    case form::Exchange::kPlaceRequest: return form.place_request().features().dense().empty() ? 1 : kDenseVersion;
    case form::Exchange::kSensed: {
      const auto& end = form.sensed().end();
      if (form.sensed().has_mapped()) return kVersion;
      if (form.sensed().has_lost_scan() || !end.notes().empty() || !end.log().empty()) return kEndVersion;
      const auto& geometry = form.sensed().geometry();
      const bool sweeps = geometry.first_ray_s() != 0.0 || geometry.ray_step_s() != 0.0;
      return sweeps || form.sensed().has_inertial_yaw_rad() ? kSweepVersion : kSensedVersion;
    }
    case form::Exchange::kMapReport: return kReportVersion;
    case form::Exchange::kMergedMaps: return kFloatVersion;
    default: return kTierVersion;
  }
}

}  // namespace

std::string written(form::Exchange& form, const SessionTable& sessions) {
  form.set_version(version_of(form));
  for (const SessionId& session : sessions.sessions()) *form.add_sessions() = form_of(session);
  return form.SerializeAsString();
}

form::Exchange read_exchange(std::string_view bytes, FormReader& reader, const std::string& where,
                             std::optional<form::Exchange::ContentCase> content) {
  const std::size_t most = content == form::Exchange::kMergedMaps ? kMostMergedBytes : kMostBytes;
  if (bytes.size() > most)
    reader.corrupt("a message of " + std::to_string(bytes.size()) + " bytes; at most " + std::to_string(most) +
                   " are expected");
  form::Exchange form;
  if (!form.ParseFromArray(bytes.data(), static_cast<int>(bytes.size())))
    reader.corrupt("these bytes are not what they should be");
  if (form.version() > kVersion)
    throw Error(ErrorCode::kUnsupported,
                "it is in form " + std::to_string(form.version()) + "; this program knows forms up to " +
                    std::to_string(kVersion),
                where, "read it with a newer mapweave");
  if (form.version() == 0 || (content && form.content_case() != *content))
    reader.corrupt("it is another message than the one expected");
  for (const auto& session : form.sessions()) reader.take_session(session);
  return form;
}

}  // namespace mapweave
