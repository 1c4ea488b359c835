#include "exchange_form.h"

#include <mapweave/maps/coordination.h>

#include <cmath>

namespace mapweave {
namespace {

bool is_amount(double x) { return std::isfinite(x) && x >= 0.0; }
bool is_sound(const EdgeIs& edge) {
  return is_amount(edge.bytes_per_s) && is_amount(edge.speed) && is_amount(edge.delay_s.value_or(0.0));
}
bool is_sound(const LinkIs& link) { return is_amount(link.bytes_per_s) && is_amount(link.delay_s); }

void fill(form::MapReport& content, const MapSummary& summary) {
  MAPWEAVE_EXPECT(
      summary.columns >= 0 && summary.rows >= 0 && summary.looks.size() <= MapSummary::kMostLooks &&
          summary.cells.size() == static_cast<std::size_t>(summary.columns) * static_cast<std::size_t>(summary.rows) &&
          summary.cells.size() <= static_cast<std::size_t>(MapSummary::kMostCells),
      "a summary has as many cells as it says");
  content.set_left(summary.left);
  content.set_bottom(summary.bottom);
  content.set_columns(static_cast<std::uint32_t>(summary.columns));
  content.set_rows(static_cast<std::uint32_t>(summary.rows));
  std::string cells((summary.cells.size() + 3) / 4, '\0');
  for (std::size_t i = 0; i < summary.cells.size(); ++i)
    cells[i / 4] = static_cast<char>(static_cast<unsigned char>(cells[i / 4]) | static_cast<unsigned>(summary.cells[i])
                                                                                    << 2 * (i % 4));
  content.set_cells(std::move(cells));
  for (const MapSummary::Look& look : summary.looks) {
    auto& line = *content.add_looks();
    line.set_x_cm(look.x_cm);
    line.set_y_cm(look.y_cm);
    line.set_walls(std::string(look.walls.begin(), look.walls.end()));
  }
  content.set_is_in_team_frame(summary.is_in_team_frame);
}

void fill(form::Exchange& form, const MapReport& report) {
  form.mutable_map_report()->set_robot(report.robot.str());
  form.mutable_map_report()->set_scans(report.scans);
  fill(*form.mutable_map_report(), report.summary);
}

void fill(form::Exchange& form, const RobotComes& comes) {
  auto& content = *form.mutable_robot_comes();
  content.set_robot(comes.robot.str());
  if (comes.route) fill(*content.mutable_route(), *comes.route);
  content.set_edge(comes.edge.str());
}

void fill(form::Exchange& form, const RobotGoes& goes) { form.mutable_robot_goes()->set_robot(goes.robot.str()); }

void fill(form::Exchange& form, const EdgeIs& edge) {
  expect_name(edge.edge, "tier");
  MAPWEAVE_EXPECT(is_sound(edge), "what an edge has are amounts");
  auto& content = *form.mutable_edge_is();
  content.set_edge(edge.edge.str());
  content.set_bytes_per_s(edge.bytes_per_s);
  content.set_speed(edge.speed);
  if (edge.capacity) content.set_capacity(*edge.capacity);
  if (edge.delay_s) content.set_delay_s(*edge.delay_s);
}

void fill(form::Exchange& form, const EdgeGoes& goes) {
  expect_name(goes.edge, "tier");
  form.mutable_edge_goes()->set_edge(goes.edge.str());
}

void fill(form::Exchange& form, const LinkIs& link) {
  expect_name(link.edge, "tier");
  MAPWEAVE_EXPECT(is_sound(link), "what a link is like are amounts");
  auto& content = *form.mutable_link_is();
  content.set_robot(link.robot.str());
  content.set_edge(link.edge.str());
  content.set_bytes_per_s(link.bytes_per_s);
  content.set_delay_s(link.delay_s);
}

template <class Event>
std::string encoded(const Event& event) {
  form::Exchange form;
  fill(form, event);
  return written(form);
}

MapSummary summary_in(const form::MapReport& content, const FormReader& reader) {
  const std::uint64_t cells = std::uint64_t{content.columns()} * content.rows();
  constexpr std::int32_t kFarthest = 1 << 24;  // cells from the origin
  if (content.columns() > kFarthest || content.rows() > kFarthest ||
      cells > static_cast<std::uint64_t>(MapSummary::kMostCells) || content.cells().size() != (cells + 3) / 4)
    reader.corrupt(std::to_string(content.columns()) + " x " + std::to_string(content.rows()) + " cells in " +
                   std::to_string(content.cells().size()) + " bytes");
  if (std::abs(std::int64_t{content.left()}) > kFarthest || std::abs(std::int64_t{content.bottom()}) > kFarthest)
    reader.corrupt("a map that lies thousands of kilometres from its origin");
  if (static_cast<std::size_t>(content.looks_size()) > MapSummary::kMostLooks)
    reader.corrupt("more viewpoints than a summary has");
  MapSummary summary;
  summary.left = content.left();
  summary.bottom = content.bottom();
  summary.columns = static_cast<std::int32_t>(content.columns());
  summary.rows = static_cast<std::int32_t>(content.rows());
  summary.cells.reserve(cells);
  for (std::size_t i = 0; i < cells; ++i) {
    const unsigned cell = static_cast<unsigned char>(content.cells()[i / 4]) >> 2 * (i % 4) & 3U;
    if (cell > static_cast<unsigned>(MapSummary::Cell::wall))
      reader.corrupt("a cell that is neither unknown, free nor a wall");
    summary.cells.push_back(static_cast<MapSummary::Cell>(cell));
  }
  for (const auto& line : content.looks()) {
    MapSummary::Look look{line.x_cm(), line.y_cm(), {}};
    if (line.walls().size() != look.walls.size())
      reader.corrupt("a viewpoint with " + std::to_string(line.walls().size()) + " rings");
    std::copy(line.walls().begin(), line.walls().end(), look.walls.begin());
    summary.looks.push_back(look);
  }
  summary.is_in_team_frame = content.is_in_team_frame();
  return summary;
}

RobotId robot_in(const std::string& text, const FormReader& reader) { return name_in<RobotId>(text, "robot", reader); }
TierId tier_in(const std::string& text, const FormReader& reader) { return name_in<TierId>(text, "tier", reader); }
TierId tier_or_none(const std::string& text, const FormReader& reader) {
  return TierId(reader.name_or_nothing(text, "tier"));
}

RobotComes event_of(const form::RobotComes& content, const FormReader& reader) {
  RobotComes comes{robot_in(content.robot(), reader), std::nullopt, tier_or_none(content.edge(), reader)};
  if (content.has_route()) comes.route = summary_in(content.route(), reader);
  return comes;
}

EdgeIs event_of(const form::EdgeIs& content, const FormReader& reader) {
  EdgeIs edge{tier_in(content.edge(), reader), content.bytes_per_s(), content.speed(), {}, {}};
  if (content.has_capacity()) edge.capacity = content.capacity();
  if (content.has_delay_s()) edge.delay_s = content.delay_s();
  if (!is_sound(edge)) reader.corrupt("an edge with what is no amount");
  return edge;
}

LinkIs event_of(const form::LinkIs& content, const FormReader& reader) {
  const LinkIs link{robot_in(content.robot(), reader), tier_in(content.edge(), reader), content.bytes_per_s(),
                    content.delay_s()};
  if (!is_sound(link)) reader.corrupt("a link with what is no amount");
  return link;
}

}  // namespace

std::string encode(const CoordinatorEvent& event) {
  return std::visit(
      [](const auto& one) {
        using Event = std::decay_t<decltype(one)>;
        if constexpr (!std::is_same_v<Event, EdgeIs> && !std::is_same_v<Event, EdgeGoes>)
          expect_name(one.robot, "robot");
        return encoded(one);
      },
      event);
}

std::string encode(const RobotMove& move) {
  expect_name(move.robot, "robot");
  form::Exchange form;
  auto& content = *form.mutable_robot_move();
  content.set_robot(move.robot.str());
  content.set_from(move.from.str());
  content.set_to(move.to.str());
  return written(form);
}

CoordinatorEvent decode_coordinator_event(std::string_view bytes, const std::string& where) {
  FormReader reader(where);
  const auto form = read_exchange(bytes, reader, where, std::nullopt);
  switch (form.content_case()) {
    case form::Exchange::kRobotComes: return event_of(form.robot_comes(), reader);
    case form::Exchange::kMapReport:
      return MapReport{robot_in(form.map_report().robot(), reader), form.map_report().scans(),
                       summary_in(form.map_report(), reader)};
    case form::Exchange::kRobotGoes: return RobotGoes{robot_in(form.robot_goes().robot(), reader)};
    case form::Exchange::kEdgeIs: return event_of(form.edge_is(), reader);
    case form::Exchange::kEdgeGoes: return EdgeGoes{tier_in(form.edge_goes().edge(), reader)};
    case form::Exchange::kLinkIs: return event_of(form.link_is(), reader);
    default: reader.corrupt("it is no message for a coordinator");
  }
}

RobotMove decode_robot_move(std::string_view bytes, const std::string& where) {
  FormReader reader(where);
  const auto form = read_exchange(bytes, reader, where, form::Exchange::kRobotMove);
  const auto& content = form.robot_move();
  return {robot_in(content.robot(), reader), tier_or_none(content.from(), reader), tier_or_none(content.to(), reader)};
}

}  // namespace mapweave
