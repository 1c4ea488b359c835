#pragma once
// What is not worth keeping: landmarks that are not found again, keyframes that show nothing of their own (ORB-SLAM,
// Mur-Artal et al., IEEE T-RO 31(5), 2015, sections VI-B and VI-E; CORB-SLAM 2.1), landmarks that exist twice.

#include "tracking/landmark_finder.h"

namespace mapweave::visual {

// After `newest` was made and its window adjusted.
void cull_landmarks(LandmarkMap& map, int newest, const MemoryOptions& options);

// The keyframe that should go next, because others show the same: -1 for none. The newest three of a session and its
// first one stay.
int keyframe_to_cull(const LandmarkMap& map, int newest, const MemoryOptions& options);
// The same because the map is full: -1 while the bound on keyframes holds, or where none may go.
int keyframe_to_forget(const LandmarkMap& map, int newest, const MemoryOptions& options);

// Who inherits a keyframe's frames: who shares most landmarks with it, or else comes next in its session; -1: it is
// alone.
int new_parent_of(const LandmarkMap& map, int keyframe);

// Of the trajectory, where it has more than `most` frames, each keyframe keeps every second one (its first one always),
// so that in the end the oldest are the farthest apart. Answers how many there are then.
std::size_t thin_frames(LandmarkMap& map, std::size_t most);

// Landmarks of these keyframes that the picture shows where it shows one of `matches`, at the same depth, are one with
// it.
void fuse_duplicates(LandmarkMap& map, const std::vector<int>& keyframes, const std::vector<Match>& matches,
                     const Pyramid& picture, const View& view);

}  // namespace mapweave::visual
