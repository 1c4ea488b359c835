#include <mapweave/core/processor_clones.h>
#include <mapweave/matching/orb_descriptor.h>

namespace mapweave::matching {
namespace {

inline void consider(NearestDescriptors& nearest, int distance, std::size_t index) {
  if (distance < nearest.distance) {
    nearest.second_distance = nearest.distance;
    nearest.distance = distance;
    nearest.first = static_cast<std::uint32_t>(index);
  } else if (distance < nearest.second_distance) {
    nearest.second_distance = distance;
  }
}

MAPWEAVE_POPCOUNT_CLONES NearestDescriptors nearest_of_all(const OrbDescriptor& query, const OrbDescriptor* among,
                                                           std::size_t count) {
  NearestDescriptors nearest;
  for (std::size_t i = 0; i < count; ++i) consider(nearest, hamming(query, among[i]), i);
  return nearest;
}

MAPWEAVE_POPCOUNT_CLONES NearestDescriptors nearest_of_chosen(const OrbDescriptor& query, const OrbDescriptor* among,
                                                              const std::uint32_t* chosen, std::size_t count) {
  NearestDescriptors nearest;
  for (std::size_t i = 0; i < count; ++i) consider(nearest, hamming(query, among[chosen[i]]), i);
  return nearest;
}

}  // namespace

NearestDescriptors nearest_descriptors(const OrbDescriptor& query, const OrbDescriptor* among, std::size_t count) {
  return nearest_of_all(query, among, count);
}
NearestDescriptors nearest_descriptors(const OrbDescriptor& query, const OrbDescriptor* among,
                                       const std::uint32_t* chosen, std::size_t count) {
  return nearest_of_chosen(query, among, chosen, count);
}

}  // namespace mapweave::matching
