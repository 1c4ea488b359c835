#include "damage.h"
#include "messages.h"

#include <mapweave/maps/coordination.h>
#include <mapweave/maps/receipt.h>

#include <gmock/gmock.h>
#include <limits>

namespace mapweave {
namespace {

using test::small_report;

template <class Event>
Event sent(const Event& event) {
  return std::get<Event>(decode_coordinator_event(encode(event), "test"));
}

int refused_of_damaged(const CoordinatorEvent& event) {
  return test::refused_of_damaged(encode(event),
                                  [](const std::string& bytes) { return decode_coordinator_event(bytes, "test"); });
}

TEST(MapReport, comes_back_as_it_was) {
  const MapReport report = small_report(), back = sent(report);
  EXPECT_EQ(back.robot, report.robot);
  EXPECT_EQ(back.scans, 1200u);
  EXPECT_EQ(back.summary.cells, report.summary.cells);
  EXPECT_EQ(back.summary.known(), 5u);
  EXPECT_EQ(back.summary.at(-3, 2), MapSummary::Cell::wall);
  EXPECT_EQ(back.summary.at(-1, 3), MapSummary::Cell::wall);
  EXPECT_EQ(back.summary.at(-4, 2), MapSummary::Cell::unknown);
  ASSERT_EQ(back.summary.looks.size(), 1u);
  EXPECT_EQ(back.summary.looks[0].walls, report.summary.looks[0].walls);
  EXPECT_EQ(back.summary.looks[0].x_cm, -120);
  EXPECT_EQ(encode(back), encode(report));
}

TEST(MapReport, refuses_what_cannot_be) {
  MapReport short_of_cells = small_report();
  short_of_cells.summary.cells.pop_back();
  EXPECT_THROW(encode(short_of_cells), ContractViolation);
  EXPECT_THROW(decode_coordinator_event(encode(Refusal{Error(ErrorCode::kBadInput, "no")}), "test"), Error);
  EXPECT_GT(refused_of_damaged(small_report()), 20);
}

TEST(CoordinatorEvent, comes_back_as_it_was) {
  const RobotComes comes = sent(RobotComes{RobotId("beta"), small_report().summary, TierId("north")});
  EXPECT_EQ(comes.robot, RobotId("beta"));
  EXPECT_EQ(comes.edge, TierId("north"));
  ASSERT_TRUE(comes.route);
  EXPECT_EQ(comes.route->cells, small_report().summary.cells);
  const RobotComes quiet = sent(RobotComes{RobotId("beta"), std::nullopt, TierId()});
  EXPECT_FALSE(quiet.route);
  EXPECT_TRUE(quiet.edge.empty());
  EXPECT_EQ(sent(RobotGoes{RobotId("beta")}).robot, RobotId("beta"));
  const EdgeIs edge = sent(EdgeIs{TierId("north"), 1e12, 0.12, 0, 0.0});
  EXPECT_EQ(edge.edge, TierId("north"));
  EXPECT_EQ(edge.bytes_per_s, 1e12);
  EXPECT_EQ(edge.speed, 0.12);
  EXPECT_EQ(edge.capacity, 0U) << "none, not any number";
  EXPECT_EQ(edge.delay_s, 0.0);
  const EdgeIs free = sent(EdgeIs{TierId("north"), 1e6, 1.0, {}, {}});
  EXPECT_FALSE(free.capacity);
  EXPECT_FALSE(free.delay_s);
  EXPECT_EQ(sent(EdgeGoes{TierId("south")}).edge, TierId("south"));
  const LinkIs link = sent(LinkIs{RobotId("alpha"), TierId("north"), 12.75e6, 0.002});
  EXPECT_EQ(link.robot, RobotId("alpha"));
  EXPECT_EQ(link.edge, TierId("north"));
  EXPECT_EQ(link.bytes_per_s, 12.75e6);
  EXPECT_EQ(link.delay_s, 0.002);
}

TEST(CoordinatorEvent, refuses_what_cannot_be) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_THROW(encode(EdgeIs{TierId("north"), nan, 1.0, {}, {}}), ContractViolation);
  EXPECT_THROW(encode(EdgeIs{TierId(), 1.0, 1.0, {}, {}}), ContractViolation);
  EXPECT_THROW(encode(LinkIs{RobotId("alpha"), TierId("north"), -1.0, 0.0}), ContractViolation);
  EXPECT_THROW(encode(RobotGoes{}), ContractViolation);
  EXPECT_GT(refused_of_damaged(RobotComes{RobotId("beta"), small_report().summary, TierId("north")}), 50);
  EXPECT_GT(refused_of_damaged(RobotGoes{RobotId("beta")}), 20);
  EXPECT_GT(refused_of_damaged(EdgeIs{TierId("north"), 1e6, 0.5, 3, 0.01}), 50);
  EXPECT_GT(refused_of_damaged(EdgeGoes{TierId("north")}), 20);
  EXPECT_GT(refused_of_damaged(LinkIs{RobotId("alpha"), TierId("north"), 1e6, 0.01}), 50);
}

TEST(RobotMove, comes_back_as_it_was_and_refuses_what_cannot_be) {
  const RobotMove move{RobotId("alpha"), TierId(), TierId("north")};
  const auto decode = [](const std::string& bytes) { return decode_robot_move(bytes, "test"); };
  const RobotMove back = decode(encode(move));
  EXPECT_EQ(back.robot, move.robot);
  EXPECT_TRUE(back.from.empty());
  EXPECT_EQ(back.to, move.to);
  EXPECT_THROW(encode(RobotMove{}), ContractViolation);
  EXPECT_GT(test::refused_of_damaged(encode(move), decode), 30);
}

}  // namespace
}  // namespace mapweave
