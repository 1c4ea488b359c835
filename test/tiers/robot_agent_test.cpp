#include <mapweave/tiers/robot_agent.h>

#include <gmock/gmock.h>
#include <mapweave/rawlog/observation_stream.h>
#include <mrpt/obs/CObservation2DRangeScan.h>
#include <mrpt/obs/CObservationComment.h>
#include <mrpt/obs/CObservationOdometry.h>

namespace mapweave::tiers {
namespace {

rawlog::Record scan(double seconds, const std::string& label = "FLASER") {
  auto observation = mrpt::obs::CObservation2DRangeScan::Create();
  observation->sensorLabel = label;
  observation->aperture = static_cast<float>(M_PI);
  observation->maxRange = 20.0F;
  observation->resizeScan(30);
  for (std::size_t ray = 0; ray < 30; ++ray) {
    observation->setScanRange(ray, 2.0F);
    observation->setScanRangeValidity(ray, true);
  }
  return {stamp_from_seconds(seconds), observation};
}

rawlog::Record odometry(double seconds, double x) {
  auto observation = mrpt::obs::CObservationOdometry::Create();
  observation->odometry = mrpt::poses::CPose2D(x, 0.0, 0.0);
  return {stamp_from_seconds(seconds), observation};
}

struct AgentTest : testing::Test {
  RobotAgent agent{RobotId("alpha")};
};

TEST_F(AgentTest, packs_scans_and_odometry_in_numbered_messages) {
  const auto first = agent.step(odometry(10.0, 0.5)), second = agent.step(scan(10.0));
  ASSERT_TRUE(first && second);
  EXPECT_EQ(first->robot, RobotId("alpha"));
  EXPECT_EQ(first->sequence, 1u);
  EXPECT_EQ(second->sequence, 2u);
  EXPECT_NEAR(std::get<Pose3>(first->body).t.x(), 0.5, 1e-12);
  EXPECT_EQ(std::get<PackedScan>(second->body).ranges.size(), 30u);
  const Sensed end = agent.end();
  EXPECT_EQ(end.sequence, 3u);
  EXPECT_FALSE(std::get<StreamEnd>(end.body).trouble);
}

TEST_F(AgentTest, counts_scans_and_their_time) {
  agent.step(odometry(9.0, 0.0));
  agent.step(scan(10.0));
  agent.step(scan(12.5));
  EXPECT_EQ(agent.scans(), 2u);
  EXPECT_DOUBLE_EQ(agent.seconds(), 2.5);
}

TEST_F(AgentTest, ships_nothing_that_a_laser_mapper_cannot_use) {
  auto comment = mrpt::obs::CObservationComment::Create();
  EXPECT_FALSE(agent.step({stamp_from_seconds(1.0), comment}));
  EXPECT_EQ(agent.step(scan(2.0))->sequence, 1u);
  EXPECT_FALSE(agent.step(scan(3.0, "another laser")));
}

TEST_F(AgentTest, refuses_time_that_runs_backwards) {
  agent.step(scan(10.0));
  try {
    agent.step(scan(9.0));
    FAIL() << "not refused";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kBadInput);
    EXPECT_THAT(error.what(), testing::HasSubstr("time runs backwards"));
  }
}

TEST_F(AgentTest, ends_in_trouble_when_there_was_no_laser) {
  agent.step(odometry(1.0, 0.0));
  const Sensed end = agent.end();
  const std::optional<Error>& trouble = std::get<StreamEnd>(end.body).trouble;
  ASSERT_TRUE(trouble);
  EXPECT_EQ(trouble->code(), ErrorCode::kBadInput);
  EXPECT_THAT(trouble->what(), testing::HasSubstr("no usable laser scan"));
}

TEST_F(AgentTest, passes_on_the_trouble_that_ended_its_log) {
  agent.step(scan(1.0));
  std::optional<Error> cut;
  cut.emplace(ErrorCode::kCorrupt, "cut short");
  const Sensed end = agent.end(cut);
  const std::optional<Error>& trouble = std::get<StreamEnd>(end.body).trouble;
  ASSERT_TRUE(trouble);
  EXPECT_EQ(trouble->code(), ErrorCode::kCorrupt);
}

}  // namespace
}  // namespace mapweave::tiers
