#pragma once
// What a client has mapped so far: keyframes, and the landmarks that they see. Both are numbered by slots that are used
// again once empty, so that memory stays bounded; serial numbers are never used again.

#include "geometry/driven_motion.h"
#include "geometry/pose_from_points.h"
#include "pictures/patch.h"

#include <mapweave/core/ids.h>
#include <mapweave/core/stamp.h>
#include <mapweave/maps/landmark.h>
#include <mapweave/matching/orb_features.h>
#include <mapweave/visual/borrowing.h>
#include <mapweave/visual/client_options.h>

#include <algorithm>
#include <array>
#include <optional>
#include <utility>

namespace mapweave::visual {

// A landmark in one keyframe.
struct Observation {
  int keyframe = 0;
  Sighting sighting;  // its point is the landmark's
};

// How a landmark looked from somewhere: from a keyframe, or near one (whose own keyframe is gone).
struct Appearance {
  Patch patch;
  Eigen::Vector2d pixel;
  int keyframe = 0;
  View from_keyframe;  // of the camera that saw it
};

// Of a landmark that others made: its point is theirs to say.
struct BorrowedLandmark {
  LandmarkId id;
  double sigma_m = 0.0;   // of its point
  double sigma_px = 0.0;  // of how it was found by its descriptor, which its patches inherit
};

struct ClientLandmark {
  Eigen::Vector3d point = Eigen::Vector3d::Zero();  // in the map
  std::vector<Observation> seen;
  std::vector<Appearance> appearances;
  int tried = 0, found = 0;              // looked for in frames
  matching::OrbDescriptor descriptor{};  // of sensors that hand over features
  std::uint32_t serial = 0;
  std::array<std::uint8_t, 3> colour{};  // red, green, blue
  bool gone = false;
  double share_unknown =
      0.0;  // sigma of its distance from the keyframe that saw it first, as a share; 0 where it was measured
  std::optional<BorrowedLandmark> borrowed;
};

inline constexpr std::size_t kSettled =
    3;  // keyframes that see a landmark whose depth was learnt measure it better than that

// Whether it may place a camera that knows nothing else.
inline bool is_known(const ClientLandmark& landmark) {
  return landmark.share_unknown < 0.15 || landmark.seen.size() >= kSettled;
}

// A frame, and where it is seen from a keyframe: it moves with it. Small and not padded, since every frame has one for
// hours.
struct AnchoredFrame {
  Stamp stamp;
  Eigen::Vector3f centre;                             // of the camera, in the keyframe's
  Eigen::Matrix<float, 4, 1, Eigen::DontAlign> turn;  // keyframe_from_frame, a quaternion x, y, z, w
};
AnchoredFrame anchored(Stamp stamp, const View& frame_from_keyframe);
View frame_from_keyframe(const AnchoredFrame& frame);

// A keyframe that went because the map is full, and where it is seen from another one: it moves with it.
struct ForgottenKeyframe {
  std::uint32_t serial = 0;
  AnchoredFrame place;
};

struct Keyframe {
  Stamp stamp;
  View view;
  DrivenMotion driven;
  std::uint32_t serial = 0;
  int session = 0;
  bool gone = false;
  std::vector<int> landmarks;
  // What it is known again by, and how deep that lies (metres along the optical axis; 0 unknown).
  matching::OrbFeatures features;
  std::vector<float> depths;
  std::vector<AnchoredFrame> frames;
  std::vector<ForgottenKeyframe> forgotten;
};

// A landmark found in a frame.
struct Match {
  int landmark = 0;
  Eigen::Vector2d pixel;
  Eigen::Vector2d row_flow;
  int level = 0;
  int feature = -1;  // of the frame, where it has features instead of a picture
};

// A corner of a keyframe that becomes a landmark, and its depth while that is being learnt.
struct DepthCandidate {
  Patch patch;
  Eigen::Vector2d pixel, row_flow;
  int keyframe = 0, landmark = -1;  // -1: it is none yet
  std::uint32_t keyframe_serial = 0, landmark_serial = 0;
  double inverse_depth = 0.0, sigma = 0.0;  // 1/m
  int found = 0, missed = 0;
  Eigen::Vector2d now = Eigen::Vector2d::Zero();  // in the last picture that was looked at
  int level_now = 0;
};

struct LandmarkMap {
  Pinhole camera;
  double baseline_m = 0.0;  // to the right camera; 0 without one
  bool monocular = false;   // nothing measures depth: scale is what each session's first keyframes made it
  std::vector<ReanchoredFrame> reanchored;  // sessions whose frame is not that of their first keyframe
  SensorCalibration calibration;
  std::vector<Keyframe> keyframes;
  std::vector<ClientLandmark> landmarks;
  std::vector<int> free_keyframes, free_landmarks;
  std::uint32_t keyframes_made = 0, landmarks_made = 0;
  // Landmarks on probation, and the keyframe (its serial number) that made them.
  std::vector<std::pair<int, std::uint32_t>> recent_landmarks;
  std::vector<DepthCandidate> candidates;          // in the order of their keyframes
  bool remembers_forgotten = false;                // somebody keeps what goes because the map is full
  std::vector<std::uint32_t> forgotten_landmarks;  // serial numbers of those that went so, until that is published

  Keyframe& keyframe(int number) { return keyframes[static_cast<std::size_t>(number)]; }
  const Keyframe& keyframe(int number) const { return keyframes[static_cast<std::size_t>(number)]; }
  ClientLandmark& landmark(int number) { return landmarks[static_cast<std::size_t>(number)]; }
  const ClientLandmark& landmark(int number) const { return landmarks[static_cast<std::size_t>(number)]; }
  bool is_reanchored(int session) const {
    return std::any_of(reanchored.begin(), reanchored.end(),
                       [&](const ReanchoredFrame& frame) { return frame.session == session; });
  }
  void drop_reanchored(int session) {
    reanchored.erase(std::remove_if(reanchored.begin(), reanchored.end(),
                                    [&](const ReanchoredFrame& frame) { return frame.session == session; }),
                     reanchored.end());
  }
  int keyframe_count() const { return static_cast<int>(keyframes.size() - free_keyframes.size()); }
  View view_of(const Appearance& appearance) const {
    return appearance.from_keyframe * keyframe(appearance.keyframe).view;
  }
  // `view`: where the picture was taken, about; lets the pose give way where depth is hardly known.
  Sighting sighting_of(const Match& match, double sigma_px, const View* view = nullptr) const {
    Sighting sighting;
    const ClientLandmark& seen = landmark(match.landmark);
    if (view != nullptr && seen.share_unknown > 0.0 && seen.seen.size() < kSettled)
      sighting.slack_px = slack_of(seen, *view);
    sighting.point_in_map = landmark(match.landmark).point;
    sighting.pixel = match.pixel;
    sighting.row_flow = match.row_flow;
    sighting.sigma_px = sigma_px * (1 << match.level);
    if (view != nullptr && seen.borrowed) widen(sighting, seen, (*view * seen.point).z());
    return sighting;
  }

  Eigen::Vector2d slack_of(const ClientLandmark& landmark, const View& view) const;
  void widen(Sighting& sighting, const ClientLandmark& borrowed,
             double depth_m) const;  // by what is not known of the landmark
  int add(Keyframe keyframe);        // its serial number is set here
  int add(ClientLandmark landmark);
  void see(int landmark, const Observation& observation);
  void forget(int landmark, int keyframe);  // that it is seen there; what nobody sees is gone
  void remove_landmark(int landmark);
  // What was anchored to it (frames, appearances) is anchored to `new_parent`, of the same session. Landmarks that only
  // one other sees go too.
  void remove_keyframe(int keyframe, int new_parent);
  // The same because the map is full: others may keep it.
  void forget_keyframe(int keyframe, int new_parent);
  // `other` is the same as `kept`, and is gone. Neither is borrowed.
  void fuse(int kept, int other);
  // A keyframe that nothing depends on yet, with the landmarks that only it sees.
  void discard(int keyframe);
};

// How many landmarks each other keyframe shares with this one.
struct CovisibleKeyframe {
  int keyframe = 0, landmarks = 0;
};
std::vector<CovisibleKeyframe> covisible(const LandmarkMap& map, int keyframe);  // by keyframe
std::vector<CovisibleKeyframe> most_first(
    std::vector<CovisibleKeyframe> shared);         // of equals, the one in the later slot
int first_of(const LandmarkMap& map, int session);  // the earliest keyframe; -1 without any
int newest_of(const LandmarkMap& map, int session);

inline constexpr std::size_t kMostAppearances = 4;  // patches of a landmark, seen from different views: bounds memory

}  // namespace mapweave::visual
