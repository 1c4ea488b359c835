// g2o pose graphs that carry scans: a VERTEX_SE2, then its ROBOTLASER1 lines. The chained edges from vertex i to i + 1
// are the odometry; the vertices' own poses are somebody's result and are not used, nor are the other edges.

#include "formats.h"
#include "laser_lines.h"

#include <mapweave/core/log.h>

#include <algorithm>
#include <unordered_map>

namespace mapweave::rawlog {
namespace {

constexpr std::size_t kMostVertices = 1'000'000'000;

class G2oReader final : public RecordSource {
 public:
  G2oReader(std::unique_ptr<ByteSource> bytes, const ReadOptions& options)
      : bytes_(std::move(bytes)), step_s_(1.0 / options.scan_rate_hz), converter_(survey_, options), lines_(*bytes_) {
    try {
      read_edges();
    } catch (const Error&) {
      std::rethrow_exception(bytes_->cause_of(std::current_exception()));
    }
    if (!survey_.has_usable_stamps() && scans_ > 0) {
      log(LogLevel::warning, bytes_->path().string() + ": its scans have no usable stamps; they get one every " +
                                 std::to_string(step_s_) + " s");
    }
  }

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
      if (*keyword == "VERTEX_SE2") {
        vertex_ = fields->count("the vertex's number", kMostVertices);
      } else if (is_laser_keyword(*keyword)) {
        if (!vertex_) throw fields->error("a scan stands before any vertex; a VERTEX_SE2 line was expected");
        parse_laser_line(*keyword, *fields, line_);
        move_to(*vertex_, *fields);
        const Stamp stamp = stamp_of(*fields);
        if (last_odometry_ != stamp) records.push_back(odometry_record(odometry_from_robot_, stamp, lines_.line()));
        last_odometry_ = stamp;
        records.push_back(converter_.scan(line_, stamp, lines_.line()));
        return true;
      }
    }
  }

  std::exception_ptr cause_of(std::exception_ptr seen) override { return bytes_->cause_of(std::move(seen)); }
  std::string place_name(std::uint64_t place) const override { return lines_.place(place); }
  std::string path() const override { return bytes_->path().string(); }
  std::string nothing_found() const override { return "a pose graph without ROBOTLASER1 lines"; }
  std::uint64_t bytes_read() const override { return bytes_->file_bytes_read(); }
  std::uint64_t bytes_total() const override { return bytes_->file_bytes(); }

 private:
  // Edges may stand anywhere, so the file is read twice.
  void read_edges() {
    LineReader lines(*bytes_);
    while (auto fields = lines.next()) {
      const auto keyword = fields->next();
      if (!keyword) continue;
      if (is_laser_keyword(*keyword)) {
        parse_laser_line(*keyword, *fields, line_);
        survey_.add(line_);
        ++scans_;
      } else if (*keyword == "VERTEX_SE2") {
        fields->count("the vertex's number", kMostVertices);
        for (const char* name : {"x", "y", "the heading"}) fields->number(name);
        fields->expect_end("the vertex");
      } else if (*keyword == "EDGE_SE2") {
        const std::size_t from = fields->count("the first vertex", kMostVertices),
                          to = fields->count("the second vertex", kMostVertices);
        Pose2 from_from_to;
        from_from_to.x = fields->number("x");
        from_from_to.y = fields->number("y");
        from_from_to.phi = wrap_angle(fields->number("the heading"));
        for (int i = 0; i < 6; ++i) fields->number("an entry of the information matrix");
        fields->expect_end("the edge");
        if (to == from + 1) steps_.try_emplace(from, from_from_to);  // of several, the first
      }
    }
    bytes_->rewind();
  }

  void move_to(std::size_t vertex, const Fields& fields) {
    if (at_ && vertex < *at_)
      throw fields.error("vertex " + std::to_string(vertex) + " with a scan comes after vertex " +
                         std::to_string(*at_) + "; rising numbers were expected");
    for (std::size_t i = at_.value_or(vertex); i < vertex; ++i) {
      const auto step = steps_.find(i);
      if (step == steps_.end()) {
        throw fields.error(
            "no edge leads from vertex " + std::to_string(i) + " to " + std::to_string(i + 1) +
            "; the edges from each vertex to the next serve as odometry: take a pose graph that has them");
      }
      odometry_from_robot_ = compose(odometry_from_robot_, step->second);
    }
    at_ = vertex;
  }

  Stamp stamp_of(const Fields& fields) {
    if (survey_.has_usable_stamps()) return stamp_of_line(survey_, line_.ipc_stamp_s, line_.logger_stamp_s, fields);
    return stamp_of_text(static_cast<double>(++stamped_) * step_s_, fields);
  }

  std::unique_ptr<ByteSource> bytes_;
  double step_s_;
  LaserSurvey survey_;
  std::unordered_map<std::size_t, Pose2> steps_;  // i from i + 1, by i; looked up only
  LaserLineConverter converter_;
  LineReader lines_;
  DamagedLines damaged_;
  LaserLine line_;
  std::optional<std::size_t> vertex_, at_;
  std::optional<Stamp> last_odometry_;
  Pose2 odometry_from_robot_;
  std::uint64_t scans_ = 0, stamped_ = 0;
};

}  // namespace

bool is_g2o(std::string_view start) {
  return any_line(start, [](std::string_view keyword, std::string_view) {
    return keyword.substr(0, 7) == "VERTEX_" || keyword.substr(0, 5) == "EDGE_";
  });
}

std::unique_ptr<RecordSource> open_g2o(std::unique_ptr<ByteSource> bytes, const ReadOptions& options) {
  return std::make_unique<G2oReader>(std::move(bytes), options);
}

}  // namespace mapweave::rawlog
