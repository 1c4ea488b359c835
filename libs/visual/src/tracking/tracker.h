#pragma once
// Where a camera is in its map, frame by frame: followed from the frame before, or found again. Of the map it changes
// only how often landmarks were looked for and found.

#include "frame_pose.h"
#include "landmark_finder.h"
#include "recent_frames.h"

#include "loops/loop_detector.h"

#include <mapweave/visual/frame.h>

#include <functional>
#include <optional>

namespace mapweave::visual {

// In the frame that was tracked last.
struct TrackedPlace {
  int session = 0;
  int reference = -1;  // the newest keyframe, or the one where the camera found itself again; -1: there is none yet
  std::size_t reference_landmarks = 0;  // that were seen then
  View view;                            // camera_from_map
  std::vector<Match> matches;           // landmarks seen
};

class Tracker {
 public:
  explicit Tracker(const ClientOptions& options) : options_(options) {}

  const TrackedPlace& place() const { return place_; }
  bool has_begun() const { return place_.reference >= 0; }
  bool has_place() const { return has_begun() && lost_s_ == 0.0; }
  double lost_s() const { return lost_s_; }               // of seeing something since
  Stamp last_stamp() const { return last_stamp_; }        // of the last frame that was tracked
  Stamp lost_stamp() const { return lost_stamp_; }        // of the last frame at all
  const DrivenMotion& driven() const { return driven_; }  // to the frame that is looked at
  // Pixels of that frame where landmarks were found that cannot be there.
  const std::vector<Eigen::Vector2d>& dynamic_outliers() const { return dynamic_outliers_; }

  // For each frame first.
  void go_on(const std::optional<Pose3>& odometry_from_camera) { visual::go_on(driven_, odometry_from_camera); }
  // From the frame before: pictures are laid on each other.
  Attempt follow(LandmarkMap& map, const Frame& frame, const Pyramid& picture);
  bool is_followed(const LandmarkMap& map, const Attempt& attempt, Stamp now) const;
  // Where the camera was last before it was led astray, as the attempt shows, alone or together with odometry.
  std::optional<Station> astray_since(const LandmarkMap& map, const Attempt& attempt, Stamp now) const;
  // As if the frames since had shown nothing; keyframes since are gone from the map.
  void go_back(const LandmarkMap& map, const Station& there);
  // By features: first around where it was, then wherever it looks alike. Places that look alike but are not the same
  // are no answer, nor are those that the camera's motion cannot have led to. best: what following came to. Without
  // `places` it looks around where it was only.
  Attempt find_again(LandmarkMap& map, const VisualLoopDetector* places, const Pyramid& picture, Stamp now,
                     Attempt best);
  bool is_good(const LandmarkMap& map, const Attempt& attempt) const;
  // Whether motion since it knew its place may have led it there; repeats_m: as in `places`.
  bool may_have_come_to(const LandmarkMap& map, const View& there, int among, Stamp now, double repeats_m) const {
    return allowed(departure_to(map, there, among, now), repeats_m) == Allowed::yes;
  }

  // The place is what the attempt says.
  void take(LandmarkMap& map, const Attempt& attempt, bool is_followed);
  void add_matches(const std::vector<Match>& found);  // of landmarks that are new
  bool is_keyframe_due(const LandmarkMap& map) const;
  void finish_tracked(Stamp stamp, Pyramid picture, double share);
  void finish_lost(Stamp stamp, bool shows_something);

  // What others do to the place: a map begins, or the frame's keyframe was made.
  void begin_at(TrackedPlace place, Stamp stamp, Pyramid picture);
  void move_to(TrackedPlace place) { place_ = std::move(place); }
  void lose_since(Stamp stamp) {
    lost_s_ = 1e-3;
    lost_stamp_ = stamp;
  }  // the camera may have come anywhere
  void drop_what_is_gone(const LandmarkMap& map);
  void join(int session) { place_.session = session; }
  void stand_at_reference(const LandmarkMap& map) { place_.view = map.keyframe(place_.reference).view; }
  // The map moves by `move`, which answers by how much the scale of each keyframe grows; the camera moves along.
  void carry(const LandmarkMap& map, const std::function<std::vector<double>()>& move);

 private:
  Attempt locate(LandmarkMap& map, const Pyramid& picture, int among, const View& start, const Motion& speed,
                 double wider = 1.0);
  // Without pictures to lay on each other, motion is expected to go on, and landmarks are looked for far and then near.
  Attempt follow_features(LandmarkMap& map, const Pyramid& picture, double interval_s);
  // By wheels or gyroscopes where they are, else as before.
  View expected_motion(const Frame& frame) const;
  Departure departure_to(const LandmarkMap& map, const View& found, int among, Stamp now) const;
  void arrive(Stamp stamp);

  ClientOptions options_;
  LandmarkFinder finder_;
  TrackedPlace place_;
  View motion_;   // view from the view before
  Pyramid last_;  // picture
  Stamp last_stamp_, lost_stamp_;
  DrivenMotion driven_, last_driven_;
  double lost_s_ = 0.0;
  std::vector<Eigen::Vector2d> dynamic_outliers_;
  RecentFrames recent_;
};

}  // namespace mapweave::visual
