#include "engine.h"

#include <mapweave/core/error.h>
#include <mrpt/obs/CObservationOdometry.h>
#include <mrpt/poses/CPose3DPDF.h>
#include <mrpt/slam/CMetricMapBuilderICP.h>

namespace mapweave::mrpt_mapper {
namespace {

class IcpEngine : public Engine {
 public:
  explicit IcpEngine(const laser::IcpOptions& options) : options_(options) {
    builder_.setVerbosityLevel(mrpt::system::LVL_ERROR);
    builder_.ICP_params = icp_parameters(options.icp);
    builder_.ICP_params.skip_cov_calculation = true;
    auto& chosen = builder_.ICP_options;
    chosen.matchAgainstTheGrid = false;
    chosen.localizationLinDistance = options.update_distance_m;
    chosen.localizationAngDistance = options.update_yaw_rad;
    chosen.insertionLinDistance = options.insert_distance_m;
    chosen.insertionAngDistance = options.insert_yaw_rad;
    chosen.minICPgoodnessToAccept = options.min_goodness;
    mrpt::maps::CSimplePointsMap::TMapDefinition points;
    points.insertionOpts.minDistBetweenLaserPoints = static_cast<float>(options.point_distance_m);
    points.insertionOpts.fuseWithExisting = false;
    points.insertionOpts.isPlanarMap = true;
    chosen.mapInitializers.push_back(points);
    builder_.initialize();
  }

  void add(const MovedScan& moved) override {
    odometry_from_robot_ = compose(odometry_from_robot_, moved.previous_from_this);
    if (!started_ && returns_in(moved.scan) < kMinReturns) {
      poses_.push_back(odometry_from_robot_);
      return;
    }
    auto odometry = mrpt::obs::CObservationOdometry::Create();
    odometry->timestamp = moved.observation->timestamp;
    odometry->odometry = mrpt::poses::CPose2D(odometry_from_robot_);
    builder_.processObservation(odometry);
    if (returns_in(moved.scan) >= kMinReturns) builder_.processObservation(moved.observation);
    const Pose2 pose = mrpt::poses::CPose2D(builder_.getCurrentPoseEstimation()->getMeanVal()).asTPose();
    if (!started_) start_ = odometry_from_robot_;
    started_ = true;
    poses_.push_back(compose(start_, pose));
    expect_memory();
  }

  std::vector<Pose2> trajectory() override { return poses_; }

 private:
  void expect_memory() const {
    const auto points = builder_.getCurrentlyBuiltMetricMap()->mapByClass<mrpt::maps::CSimplePointsMap>();
    if (points && static_cast<double>(points->size()) * kBytesPerPoint > options_.memory_limit_mb * 1e6)
      throw Error(
          ErrorCode::kBadInput,
          "the map of " + std::to_string(points->size()) +
              " points needs more than memory_limit_mb: a larger point_distance_m or insert_distance_m needs less");
  }

  laser::IcpOptions options_;
  mrpt::slam::CMetricMapBuilderICP builder_;
  Pose2 odometry_from_robot_, start_;
  bool started_ = false;
  std::vector<Pose2> poses_;
};

}  // namespace

std::unique_ptr<Engine> make_engine(const laser::IcpOptions& options) { return std::make_unique<IcpEngine>(options); }

}  // namespace mapweave::mrpt_mapper
