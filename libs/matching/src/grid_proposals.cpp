#include <mapweave/matching/grid_proposals.h>

#include "distinct_alignments.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace mapweave::matching {
namespace {

constexpr double kCell_m = 0.4;       // coarse: a proposal is refined later
constexpr int kMostCells = 1024;      // across: bounds time; larger grids get larger cells
constexpr double kBlur_cells = 1.25;  // how far apart walls may lie and still speak for a shift
constexpr double kShallow_m = 0.5;    // free space begins to contradict walls at this depth and does so fully
constexpr double kDeep_m = 1.0;       // at this
constexpr int kPeaks = 4;             // of each rotation and scale
// Bins of a degree; peaks of one direction lie nearer than that.
constexpr int kDirections = 360, kDirectionsApart = 6;
constexpr double kDirectionBlur = 2.5;  // bins: how far normals of one wall scatter

enum Channel { kNormalX, kNormalY, kFree, kFaces, kChannels };
using Channels = std::array<cv::Mat, kChannels>;

struct Extent {
  double x0 = 1e30, y0 = 1e30, x1 = -1e30, y1 = -1e30;
  void add(double x, double y) {
    x0 = std::min(x0, x);
    y0 = std::min(y0, y);
    x1 = std::max(x1, x);
    y1 = std::max(y1, y);
  }
  double width() const { return x1 - x0; }
  double height() const { return y1 - y0; }
};

Extent extent_of(const std::vector<WallPoint>& faces) {
  Extent extent;
  for (const auto& face : faces) extent.add(face.x, face.y);
  return extent;
}

struct WeightedPoint {
  double x, y;
  float weight;
};

// Free space that contradicts walls, one point a block.
std::vector<WeightedPoint> deep_points(const GridWalls& walls, double block_m) {
  const int step = std::max(1, static_cast<int>(std::lround(block_m / walls.cell_m)));
  std::vector<WeightedPoint> points;
  for (int row = 0; row < walls.rows; row += step)
    for (int column = 0; column < walls.columns; column += step) {
      double sum = 0.0;
      for (int y = row; y < std::min(row + step, walls.rows); ++y)
        for (int x = column; x < std::min(column + step, walls.columns); ++x)
          sum += std::clamp((walls.depth_m[static_cast<std::size_t>(y) * static_cast<std::size_t>(walls.columns) +
                                           static_cast<std::size_t>(x)] -
                             kShallow_m) /
                                (kDeep_m - kShallow_m),
                            0.0, 1.0);
      if (sum > 0.0)
        points.push_back({walls.origin_x_m + (column + 0.5 * step) * walls.cell_m,
                          walls.origin_y_m + (row + 0.5 * step) * walls.cell_m,
                          static_cast<float>(sum / (step * step))});
    }
  return points;
}

std::vector<double> direction_histogram(const GridWalls& walls) {
  std::vector<double> counts(kDirections, 0.0), smooth(kDirections, 0.0);
  for (const auto& face : walls.faces) {
    const double turn = std::atan2(face.normal_y, face.normal_x) / (2.0 * M_PI);
    counts[static_cast<std::size_t>((turn - std::floor(turn)) * kDirections) % kDirections] += 1.0;
  }
  for (int i = 0; i < kDirections; ++i)
    for (int j = -9; j <= 9; ++j)
      smooth[static_cast<std::size_t>(i)] += counts[static_cast<std::size_t>((i + j + kDirections) % kDirections)] *
                                             std::exp(-0.5 * std::pow(j / kDirectionBlur, 2.0));
  return smooth;
}

std::vector<double> rotations_of(const GridWalls& a, const GridWalls& b, int most) {
  const auto in_a = direction_histogram(a), in_b = direction_histogram(b);
  std::vector<std::pair<double, int>> scored;
  for (int turn = 0; turn < kDirections; ++turn) {
    double sum = 0.0;
    for (int i = 0; i < kDirections; ++i)
      sum += in_a[static_cast<std::size_t>((i + turn) % kDirections)] * in_b[static_cast<std::size_t>(i)];
    scored.emplace_back(-sum, turn);
  }
  std::sort(scored.begin(), scored.end());
  std::vector<int> taken;
  for (const auto& [score, turn] : scored) {
    const bool apart = std::all_of(taken.begin(), taken.end(), [turn = turn](int other) {
      const int distance = std::abs(turn - other);
      return std::min(distance, kDirections - distance) > kDirectionsApart;
    });
    if (apart && static_cast<int>(taken.size()) < most) taken.push_back(turn);
  }
  std::vector<double> rotations_rad;
  for (const int turn : taken) rotations_rad.push_back(turn * 2.0 * M_PI / kDirections);
  return rotations_rad;
}

class ShiftSearch {
 public:
  ShiftSearch(const GridWalls& a, const GridWalls& b, double largest_scale) : b_(b), extent_a_(extent_of(a.faces)) {
    const Extent extent_b = extent_of(b.faces);
    const double across_b = std::hypot(extent_b.width(), extent_b.height()) * largest_scale + 2.0;
    const double needed_m = std::max(extent_a_.width(), extent_a_.height()) + across_b + 2.0;
    cell_m_ = std::max(kCell_m, needed_m / (kMostCells - 2));
    side_ = cv::getOptimalDFTSize(static_cast<int>(needed_m / cell_m_) + 2);
    deep_b_ = deep_points(b, cell_m_ / 2.0);
    Channels channels = drawn(a.faces, deep_points(a, cell_m_ / 2.0), {Pose2(-extent_a_.x0, -extent_a_.y0, 0.0), 1.0});
    // Blurred but as high as before, so that a wall that lies exactly on the other counts one.
    for (const Channel channel : {kNormalX, kNormalY}) {
      cv::GaussianBlur(channels[channel], channels[channel], cv::Size(0, 0), kBlur_cells, kBlur_cells,
                       cv::BORDER_CONSTANT);
      channels[channel] *= std::sqrt(2.0 * M_PI) * kBlur_cells;
    }
    for (int i = 0; i < kChannels; ++i)
      cv::dft(channels[static_cast<std::size_t>(i)], spectra_a_[static_cast<std::size_t>(i)]);
  }

  void search(double rotation_rad, double scale, double contradiction, std::vector<GridProposal>& found) const {
    PlanarSimilarity turned{Pose2(0.0, 0.0, rotation_rad), scale};
    Extent extent;
    for (const auto& face : b_.faces) {
      const Point2f p = transformed(turned, {face.x, face.y});
      extent.add(p.x, p.y);
    }
    turned.pose.x = 1.0 - extent.x0;
    turned.pose.y = 1.0 - extent.y0;
    Channels spectra = drawn(b_.faces, deep_b_, turned);
    for (auto& channel : spectra) cv::dft(channel, channel);
    const auto product = [&](Channel in_a, Channel in_b) {
      cv::Mat result;
      cv::mulSpectrums(spectra_a_[in_a], spectra[in_b], result, 0, true);
      return result;
    };
    cv::Mat score = product(kNormalX, kNormalX) + product(kNormalY, kNormalY) -
                    contradiction * (product(kFree, kFaces) + product(kFaces, kFree));
    cv::idft(score, score, cv::DFT_SCALE | cv::DFT_REAL_OUTPUT);
    const int columns_b = static_cast<int>(extent.width() / cell_m_) + 3,
              rows_b = static_cast<int>(extent.height() / cell_m_) + 3;
    for (int peak = 0; peak < kPeaks; ++peak) {
      cv::Point at;
      double value = 0.0;
      cv::minMaxLoc(score, nullptr, &value, nullptr, &at);
      const int dx = at.x < side_ - columns_b ? at.x : at.x - side_, dy = at.y < side_ - rows_b ? at.y : at.y - side_;
      PlanarSimilarity placed = turned;
      placed.pose.x += dx * cell_m_ + extent_a_.x0;
      placed.pose.y += dy * cell_m_ + extent_a_.y0;
      found.push_back({placed, value});
      blank(score, at);
    }
  }

 private:
  Channels drawn(const std::vector<WallPoint>& faces, const std::vector<WeightedPoint>& deep,
                 const PlanarSimilarity& raster_from_walls) const {
    Channels channels;
    for (auto& channel : channels) channel = cv::Mat::zeros(side_, side_, CV_32F);
    const double c = std::cos(raster_from_walls.pose.phi), s = std::sin(raster_from_walls.pose.phi);
    const auto cell = [&](double x, double y) {
      const Point2f p = transformed(raster_from_walls, {static_cast<float>(x), static_cast<float>(y)});
      const int column = static_cast<int>(std::floor(p.x / cell_m_)), row = static_cast<int>(std::floor(p.y / cell_m_));
      return cv::Point(((column % side_) + side_) % side_, ((row % side_) + side_) % side_);
    };
    for (const auto& face : faces) {
      const cv::Point at = cell(face.x, face.y);
      channels[kNormalX].at<float>(at) += static_cast<float>(c * face.normal_x - s * face.normal_y);
      channels[kNormalY].at<float>(at) += static_cast<float>(s * face.normal_x + c * face.normal_y);
      channels[kFaces].at<float>(at) += 1.0F;
    }
    // However thick a wall is drawn, a cell of it counts two at most.
    for (int row = 0; row < side_; ++row)
      for (int column = 0; column < side_; ++column) {
        float &x = channels[kNormalX].at<float>(row, column), &y = channels[kNormalY].at<float>(row, column);
        float& count = channels[kFaces].at<float>(row, column);
        const float shrink = 1.0F / std::max(1.0F, std::hypot(x, y) / 2.0F);
        x *= shrink;
        y *= shrink;
        count = std::min(count, 2.0F);
      }
    const float area =
        static_cast<float>(raster_from_walls.scale * raster_from_walls.scale / 4.0);  // of a block in cells
    for (const auto& point : deep) channels[kFree].at<float>(cell(point.x, point.y)) += point.weight * area;
    return channels;
  }

  void blank(cv::Mat& score, cv::Point at) const {
    const int reach = std::max(3, static_cast<int>(3.0 / cell_m_));
    for (int y = -reach; y <= reach; ++y)
      for (int x = -reach; x <= reach; ++x)
        score.at<float>((at.y + y + side_) % side_, (at.x + x + side_) % side_) = -1e9F;
  }

  const GridWalls& b_;
  Extent extent_a_;
  double cell_m_ = 0.0;
  int side_ = 0;
  std::vector<WeightedPoint> deep_b_;
  Channels spectra_a_;
};

}  // namespace

Point2f transformed(const PlanarSimilarity& a_from_b, Point2f p) {
  const double c = a_from_b.scale * std::cos(a_from_b.pose.phi), s = a_from_b.scale * std::sin(a_from_b.pose.phi);
  return {static_cast<float>(a_from_b.pose.x + c * p.x - s * p.y),
          static_cast<float>(a_from_b.pose.y + s * p.x + c * p.y)};
}

std::vector<GridProposal> propose_alignments(const GridWalls& a, const GridWalls& b,
                                             const GridProposalOptions& options) {
  if (a.faces.empty() || b.faces.empty()) return {};
  const int steps = static_cast<int>(std::lround(options.scale_range / options.scale_step));
  const ShiftSearch shifts(a, b, 1.0 + options.scale_range);
  std::vector<GridProposal> found;
  for (const double rotation_rad : rotations_of(a, b, options.rotations))
    for (int step = -steps; step <= steps; ++step)
      shifts.search(rotation_rad, 1.0 + step * options.scale_step, options.contradiction, found);
  std::stable_sort(found.begin(), found.end(),
                   [](const GridProposal& one, const GridProposal& other) { return one.score > other.score; });

  const Extent extent = extent_of(b.faces);
  const Point2f middle_in_b{static_cast<float>(0.5 * (extent.x0 + extent.x1)),
                            static_cast<float>(0.5 * (extent.y0 + extent.y1))};
  std::vector<GridProposal> distinct;
  std::vector<Point2f> middles;
  for (const auto& proposal : found) {
    if (static_cast<int>(distinct.size()) == options.most) break;
    const Point2f middle = transformed(proposal.a_from_b, middle_in_b);
    bool apart = true;
    for (std::size_t i = 0; i < distinct.size() && apart; ++i)
      apart = std::hypot(middle.x - middles[i].x, middle.y - middles[i].y) > kApart_m ||
              std::abs(wrap_angle(proposal.a_from_b.pose.phi - distinct[i].a_from_b.pose.phi)) > kApart_rad;
    if (!apart) continue;
    distinct.push_back(proposal);
    middles.push_back(middle);
  }
  return distinct;
}

}  // namespace mapweave::matching
