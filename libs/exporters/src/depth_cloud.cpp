#include <mapweave/exporters/depth_cloud.h>

#include <mapweave/core/error.h>

#include <algorithm>
#include <cmath>

namespace mapweave::exporters {
namespace {

constexpr std::uint32_t kParts = 1024;          // of a voxel's side
constexpr std::uint32_t kMostPoints = 1 << 16;  // of a voxel: more do not change its mean
constexpr double kBytesPerVoxel = 80.0;         // an entry of the table with all that the allocator adds
constexpr double kFarthest_m = 1e7;

}  // namespace

std::size_t DepthCloud::VoxelHash::operator()(const Voxel& voxel) const {
  std::uint64_t hash = 0;
  for (const std::int32_t number : voxel) {
    hash = (hash ^ static_cast<std::uint32_t>(number)) * 0x9e3779b97f4a7c15u;
    hash ^= hash >> 29;
  }
  return static_cast<std::size_t>(hash);
}

DepthCloud::DepthCloud(const DepthCloudOptions& options)
    : voxel_m_(options.voxel_m),
      most_voxels_(static_cast<std::size_t>(std::max(8.0, 1e6 * options.memory_mb / kBytesPerVoxel))) {
  MAPWEAVE_EXPECT(options.voxel_m >= 0.005, "voxels have a size");
}

void DepthCloud::add(const std::vector<ColouredPoint>& points_in_map) {
  for (const ColouredPoint& point : points_in_map) {
    MAPWEAVE_EXPECT(point.point.allFinite(), "a point is finite");
    if (static_cast<double>(point.point.cwiseAbs().maxCoeff()) > kFarthest_m) continue;
    Voxel voxel;
    std::array<std::uint32_t, 3> place;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double sides = static_cast<double>(point.point(static_cast<int>(axis))) / voxel_m_,
                   whole = std::floor(sides);
      voxel[axis] = static_cast<std::int32_t>(whole);
      place[axis] = std::min(kParts - 1, static_cast<std::uint32_t>(kParts * (sides - whole)));
    }
    Gathered& gathered = voxels_[voxel];
    if (gathered.count < kMostPoints) {
      ++gathered.count;
      for (std::size_t axis = 0; axis < 3; ++axis) {
        gathered.place[axis] += place[axis];
        gathered.colour[axis] += point.rgb >> (16 - 8 * axis) & 0xff;
      }
    }
    while (voxels_.size() > most_voxels_) coarsen();
  }
}

void DepthCloud::halve(Gathered& gathered) {
  for (std::size_t axis = 0; axis < 3; ++axis) {
    gathered.place[axis] /= 2;
    gathered.colour[axis] /= 2;
  }
  gathered.count /= 2;
}

void DepthCloud::coarsen() {
  std::unordered_map<Voxel, Gathered, VoxelHash> finer;
  finer.swap(voxels_);
  voxel_m_ *= 2.0;
  // The sums of up to eight are whole numbers again, whatever the order.
  for (auto entry = finer.begin(); entry != finer.end(); entry = finer.erase(entry)) {
    const auto& [voxel, part] = *entry;
    Voxel parent;
    for (std::size_t axis = 0; axis < 3; ++axis) parent[axis] = voxel[axis] >> 1;
    Gathered& whole = voxels_[parent];
    whole.count += part.count;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const std::uint32_t half = static_cast<std::uint32_t>(voxel[axis] & 1) * (kParts / 2);
      whole.place[axis] += half * part.count + part.place[axis] / 2;
      whole.colour[axis] += part.colour[axis];
    }
  }
  for (auto& [voxel, gathered] : voxels_)
    while (gathered.count > kMostPoints) halve(gathered);
}

std::vector<ColouredPoint> DepthCloud::points() const {
  std::vector<std::pair<Voxel, const Gathered*>> sorted;
  sorted.reserve(voxels_.size());
  for (const auto& [voxel, gathered] : voxels_) sorted.emplace_back(voxel, &gathered);
  std::sort(sorted.begin(), sorted.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<ColouredPoint> result;
  result.reserve(sorted.size());
  for (const auto& [voxel, gathered] : sorted) {
    ColouredPoint point;
    for (std::size_t axis = 0; axis < 3; ++axis) {
      const double place = (static_cast<double>(gathered->place[axis]) / gathered->count + 0.5) / kParts;
      point.point(static_cast<int>(axis)) = static_cast<float>((voxel[axis] + place) * voxel_m_);
      point.rgb = point.rgb << 8 | (gathered->colour[axis] + gathered->count / 2) / gathered->count;
    }
    result.push_back(point);
  }
  return result;
}

}  // namespace mapweave::exporters
