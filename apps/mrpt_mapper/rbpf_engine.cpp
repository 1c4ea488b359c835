#include "engine.h"
#include "local_matcher.h"

#include <mapweave/core/error.h>
#include <mrpt/maps/COccupancyGridMap2D.h>
#include <mrpt/obs/CActionRobotMovement2D.h>
#include <mrpt/random/RandomGenerators.h>
#include <mrpt/slam/CMetricMapBuilderRBPF.h>

#include <algorithm>
#include <cmath>

namespace mapweave::mrpt_mapper {
namespace {

using mrpt::slam::CMetricMapBuilderRBPF;

constexpr double kGridMargin_m = 12.0;  // what MRPT adds on a side when a grid grows, and some

CMetricMapBuilderRBPF::TConstructionOptions builder_options(const laser::RbpfOptions& options) {
  CMetricMapBuilderRBPF::TConstructionOptions result;
  result.verbosity_level = mrpt::system::LVL_ERROR;
  result.localizeLinDistance = static_cast<float>(options.update_distance_m);
  result.localizeAngDistance = static_cast<float>(options.update_yaw_rad);
  result.insertionLinDistance = static_cast<float>(options.insert_distance_m);
  result.insertionAngDistance = static_cast<float>(options.insert_yaw_rad);
  result.PF_options.PF_algorithm = mrpt::bayes::CParticleFilter::pfOptimalProposal;
  result.PF_options.resamplingMethod = mrpt::bayes::CParticleFilter::prSystematic;
  result.PF_options.adaptiveSampleSize = false;
  result.PF_options.sampleSize = static_cast<unsigned>(options.particles);
  result.PF_options.BETA = options.resample_below;
  result.PF_options.powFactor = options.weight_power;
  result.predictionOptions.pfOptimalProposal_mapSelection = 3;  // the points
  result.predictionOptions.ICPGlobalAlign_MinQuality =
      0.0f;  // MRPT takes the pose of ICP before it looks at this, and only says otherwise
  result.predictionOptions.icp_params = icp_parameters(options.icp);
  // Poses are drawn from this covariance, and MRPT's is wide: without it, its floor of 2 mm and 0.1 degree remains. On
  // intel: 0.03 m against 0.7 m of error.
  result.predictionOptions.icp_params.skip_cov_calculation = true;

  mrpt::maps::COccupancyGridMap2D::TMapDefinition grid;
  grid.resolution = static_cast<float>(options.grid.resolution_m);
  grid.insertionOpts.maxDistanceInsertion = static_cast<float>(options.grid.ray_length_m);
  grid.insertionOpts.maxOccupancyUpdateCertainty = static_cast<float>(options.grid.certainty);
  grid.insertionOpts.considerInvalidRangesAsFreeSpace = false;
  grid.insertionOpts.wideningBeamsWithDistance = false;
  grid.likelihoodOpts.likelihoodMethod = mrpt::maps::COccupancyGridMap2D::lmLikelihoodField_Thrun;
  grid.likelihoodOpts.LF_stdHit = static_cast<float>(options.grid.sigma_m);
  grid.likelihoodOpts.LF_maxCorrsDistance = static_cast<float>(options.grid.match_distance_m);
  grid.likelihoodOpts.LF_maxRange = static_cast<float>(options.grid.ray_length_m);
  grid.likelihoodOpts.LF_decimation = static_cast<std::uint32_t>(options.grid.ray_decimation);
  grid.likelihoodOpts.LF_zHit = 0.999f;
  grid.likelihoodOpts.LF_zRandom = 0.001f;
  grid.likelihoodOpts.enableLikelihoodCache = false;  // eight bytes a cell
  result.mapsInitializers.push_back(grid);

  mrpt::maps::CSimplePointsMap::TMapDefinition points;
  points.insertionOpts.minDistBetweenLaserPoints = static_cast<float>(options.point_distance_m);
  points.insertionOpts.isPlanarMap = true;
  points.genericMapParams.enableObservationLikelihood = false;
  result.mapsInitializers.push_back(points);
  return result;
}

class RbpfEngine : public Engine {
 public:
  explicit RbpfEngine(const laser::RbpfOptions& options) : options_(options), builder_(builder_options(options)) {
    builder_.setVerbosityLevel(mrpt::system::LVL_ERROR);
    mrpt::random::getRandomGenerator().randomize(options.seed);
  }

  void add(const MovedScan& moved) override {
    const Pose2 motion = corrected_motion(moved);
    motion_since_update_ = compose(motion_since_update_, motion);
    motion_since_feed_ = compose(motion_since_feed_, motion);
    if (returns_in(moved.scan) >= kMinReturns) {
      expect_memory();
      feed(moved);
    }
    scans_.push_back({updates_, motion_since_update_});
  }

  // The path of the likeliest particle. Between two updates odometry leads; what it missed by the later one is shared
  // out evenly.
  std::vector<Pose2> trajectory() override {
    std::deque<mrpt::math::TPose3D> path;
    builder_.getCurrentMostLikelyPath(path);
    const auto at = [&](std::size_t update) { return Pose2{path[update].x, path[update].y, path[update].yaw}; };
    std::vector<Pose2> poses;
    poses.reserve(scans_.size());
    for (std::size_t begin = 0, end = 0; begin < scans_.size(); begin = end) {
      const std::size_t update = scans_[begin].update;
      while (end < scans_.size() && scans_[end].update == update) ++end;
      Pose2 missed;
      if (update + 1 < path.size()) {
        const Pose2 expected = compose(at(update), update_motions_[update]), found = at(update + 1);
        missed = {found.x - expected.x, found.y - expected.y, wrap_angle(found.phi - expected.phi)};
      }
      for (std::size_t i = begin; i < end; ++i) {
        const double share = static_cast<double>(i - begin) / static_cast<double>(end - begin);
        const Pose2 pose = compose(at(update), scans_[i].update_from_scan);
        poses.push_back(
            {pose.x + share * missed.x, pose.y + share * missed.y, wrap_angle(pose.phi + share * missed.phi)});
      }
    }
    return poses;
  }

 private:
  struct Placed {
    std::size_t update;      // the filter's last update before or at the scan: index of the particles' paths
    Pose2 update_from_scan;  // by odometry
  };

  // ICP with a particle's map converges only from near: where wheels slip, the key scans before correct them first.
  Pose2 corrected_motion(const MovedScan& moved) {
    motion_since_match_ = compose(motion_since_match_, moved.previous_from_this);
    const bool moved_enough = std::hypot(motion_since_match_.x, motion_since_match_.y) > options_.match_distance_m ||
                              std::abs(motion_since_match_.phi) > options_.match_yaw_rad;
    if (!options_.correct_odometry || !moved.by_wheels || returns_in(moved.scan) < kMinReturns)
      return moved.previous_from_this;
    if (matched_any_ && !moved_enough) return moved.previous_from_this;
    const auto matched = matcher_.place(*moved.observation, motion_since_match_);
    const Pose2 correction = matched ? between(motion_since_match_, *matched) : Pose2{};
    motion_since_match_ = {};
    matched_any_ = true;
    return compose(moved.previous_from_this, correction);
  }

  void feed(const MovedScan& moved) {
    mrpt::obs::CActionRobotMovement2D movement;
    movement.timestamp = moved.observation->timestamp;
    movement.computeFromOdometry(mrpt::poses::CPose2D(motion_since_feed_), {});
    mrpt::obs::CActionCollection action;
    action.insert(movement);
    mrpt::obs::CSensoryFrame frame;
    frame.insert(moved.observation);
    builder_.processActionObservation(action, frame);
    motion_since_feed_ = {};
    const std::size_t updates = builder_.mapPDF.m_particles.front().d->robotPath.size() - 1;
    if (updates == updates_) return;
    updates_ = updates;
    update_motions_.push_back(motion_since_update_);
    motion_since_update_ = {};
    const auto& pose = builder_.mapPDF.m_particles.front().d->robotPath.back();
    last_ = {pose.x, pose.y, pose.yaw};
  }

  // MRPT's maps grow without asking. A grid's extent follows that of the path.
  void expect_memory() {
    const Pose2 here = compose(last_, motion_since_update_);
    low_x_ = std::min(low_x_, here.x);
    low_y_ = std::min(low_y_, here.y);
    high_x_ = std::max(high_x_, here.x);
    high_y_ = std::max(high_y_, here.y);
    const double border_m = 2.0 * (options_.grid.ray_length_m + kGridMargin_m);
    const double cells = (high_x_ - low_x_ + border_m) * (high_y_ - low_y_ + border_m) /
                         (options_.grid.resolution_m * options_.grid.resolution_m);
    const auto points = builder_.mapPDF.m_particles.front().d->mapTillNow.mapByClass<mrpt::maps::CSimplePointsMap>();
    const double bytes = (cells * sizeof(mrpt::maps::COccupancyGridMap2D::cellType) +
                          static_cast<double>(points->size()) * kBytesPerPoint) *
                         (options_.particles + 2);
    if (bytes > options_.memory_limit_mb * 1e6)
      throw Error(ErrorCode::kBadInput,
                  "the particles' maps would take " + std::to_string(std::llround(bytes / 1e6)) + " MB for a path of " +
                      std::to_string(std::llround(high_x_ - low_x_)) + " x " +
                      std::to_string(std::llround(high_y_ - low_y_)) +
                      " m, more than memory_limit_mb: fewer particles, coarser cells or shorter rays need less");
  }

  laser::RbpfOptions options_;
  CMetricMapBuilderRBPF builder_;
  LocalMatcher matcher_{false};
  bool matched_any_ = false;
  Pose2 motion_since_match_, motion_since_update_, motion_since_feed_, last_;
  std::size_t updates_ = 0;
  std::vector<Placed> scans_;
  std::vector<Pose2> update_motions_;  // by odometry, from each update to the next
  double low_x_ = 0.0, low_y_ = 0.0, high_x_ = 0.0, high_y_ = 0.0;
};

}  // namespace

std::unique_ptr<Engine> make_engine(const laser::RbpfOptions& options) { return std::make_unique<RbpfEngine>(options); }

}  // namespace mapweave::mrpt_mapper
