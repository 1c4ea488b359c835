// CARMEN's text logs: old style (FLASER, RLASER) and new style (ROBOTLASER1, ...), ODOM and PARAM.

#include "formats.h"
#include "laser_lines.h"

#include <algorithm>

namespace mapweave::rawlog {
namespace {

struct OdometryLine {
  Pose2 odometry_from_robot;
  double ipc_stamp_s, logger_stamp_s;
};

OdometryLine parse_odometry(Fields& fields) {
  OdometryLine line{};
  line.odometry_from_robot.x = fields.number("x");
  line.odometry_from_robot.y = fields.number("y");
  line.odometry_from_robot.phi = wrap_angle(fields.number("the heading"));
  for (const char* name : {"the speed", "the turn rate", "the acceleration"}) fields.any_number(name);
  line.ipc_stamp_s = fields.number("the ipc stamp");
  fields.text("the host's name");
  line.logger_stamp_s = fields.number("the logger's stamp");
  fields.expect_end("the line");
  return line;
}

class CarmenReader final : public RecordSource {
 public:
  CarmenReader(std::unique_ptr<ByteSource> bytes, const ReadOptions& options)
      : bytes_(std::move(bytes)), survey_(survey(*bytes_)), converter_(survey_, options), lines_(*bytes_) {}

  bool read(std::vector<PlacedRecord>& records) override {
    for (;;) {
      auto fields = lines_.next();
      if (!fields) {
        damaged_.report(lines_);
        return false;
      }
      const auto keyword = fields->next();
      if (!keyword) continue;
      damaged_.look_at(*keyword, lines_.line());
      if (is_laser_keyword(*keyword)) {
        parse_laser_line(*keyword, *fields, line_);
        const Stamp stamp = stamp_of_line(survey_, line_.ipc_stamp_s, line_.logger_stamp_s, *fields);
        if (survey_.poses_move() && last_odometry_ != stamp) {  // two lasers may speak of one instant
          records.push_back(odometry_record(line_.world_from_robot, stamp, lines_.line()));
          last_odometry_ = stamp;
        }
        records.push_back(converter_.scan(line_, stamp, lines_.line()));
        return true;
      }
      if (*keyword == "ODOM") {
        const OdometryLine odometry = parse_odometry(*fields);
        // Laser lines bring the odometry of their instant. ODOM lines may be of another frame (corrected logs), so both
        // are never mixed.
        if (survey_.poses_move()) continue;
        const Stamp stamp = stamp_of_line(survey_, odometry.ipc_stamp_s, odometry.logger_stamp_s, *fields);
        records.push_back(odometry_record(odometry.odometry_from_robot, stamp, lines_.line()));
        return true;
      }
    }
  }

  std::exception_ptr cause_of(std::exception_ptr seen) override { return bytes_->cause_of(std::move(seen)); }
  std::string place_name(std::uint64_t place) const override { return lines_.place(place); }
  std::string path() const override { return bytes_->path().string(); }
  std::string nothing_found() const override { return "no line of FLASER, RLASER, ROBOTLASER or ODOM"; }
  std::uint64_t bytes_read() const override { return bytes_->file_bytes_read(); }
  std::uint64_t bytes_total() const override { return bytes_->file_bytes(); }

 private:
  // Reads the whole log once, as far as it is good: what is wrong is reported when the stream comes there.
  static LaserSurvey survey(ByteSource& bytes) {
    LaserSurvey survey;
    LaserLine line;
    try {
      LineReader lines(bytes);
      while (auto fields = lines.next()) {
        const auto keyword = fields->next();
        if (!keyword) continue;
        if (is_laser_keyword(*keyword)) {
          parse_laser_line(*keyword, *fields, line);
          survey.add(line);
        } else if (*keyword == "PARAM") {
          add_parameter(*fields, survey);
        }
      }
    } catch (const Error&) {}
    bytes.rewind();
    return survey;
  }

  static void add_parameter(Fields& fields, LaserSurvey& survey) {
    const auto name = fields.next();
    if (!name || name->find("laser") == std::string_view::npos) return;
    try {
      survey.add_parameter(*name, fields.number("a value"));
    } catch (const Error&) {  // a text, such as "on"
    }
  }

  std::unique_ptr<ByteSource> bytes_;
  LaserSurvey survey_;
  LaserLineConverter converter_;
  LineReader lines_;
  DamagedLines damaged_;
  LaserLine line_;
  std::optional<Stamp> last_odometry_;
};

}  // namespace

bool is_carmen(std::string_view start) {
  return any_line(start, [](std::string_view keyword, std::string_view line) {
    return is_laser_keyword(keyword) || keyword == "ODOM" || keyword == "PARAM" || line.substr(0, 8) == "# CARMEN" ||
           line.substr(0, 25) == "# message formats defined";
  });
}

std::unique_ptr<RecordSource> open_carmen(std::unique_ptr<ByteSource> bytes, const ReadOptions& options) {
  return std::make_unique<CarmenReader>(std::move(bytes), options);
}

}  // namespace mapweave::rawlog
