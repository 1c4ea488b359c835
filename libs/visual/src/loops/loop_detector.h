#pragma once
// The camera is back where it was long ago, or in a place that another session knows: keyframes that look alike are
// judged (visual_judge.h), then compared landmark by landmark. Believed is what several keyframes say alike and what
// the path between could have led to. What looks the same where the path cannot have led is another place: from then
// on, nothing is believed that a step to such a place would explain as well.

#include "tracking/landmark_finder.h"
#include "tracking/place_finder.h"

#include <mapweave/matching/place_index.h>

#include <deque>

namespace mapweave::visual {

// A keyframe that another client made and that stays where it is, and what of its landmarks the newest one shows.
struct FixedPlace {
  NodeId keyframe;
  View view;
  std::vector<Sighting> sightings;
};

struct FoundLoop {
  int newest = 0, earlier = 0;  // keyframes
  View view;                    // of the newest keyframe, as the earlier one's map says
  double scale =
      1.0;  // what is one long to the newest keyframe is so long to the earlier one; 1 where depth is measured
  std::vector<Match> matches;            // landmarks of the earlier ones that the newest keyframe's picture shows
  std::uint32_t serial = 0;              // of the newest keyframe
  std::vector<std::uint32_t> serials;    // of the landmarks
  std::optional<FixedPlace> fixed = {};  // in place of `earlier`
};

// earlier's map from newest's map, where the two differ.
View correction_of(const LandmarkMap& map, const FoundLoop& loop);

class VisualLoopDetector {
 public:
  VisualLoopDetector(const matching::BinaryVocabulary& vocabulary, const ClientOptions& options);
  void add(const LandmarkMap& map, int keyframe);
  void remove(int keyframe);
  // Keyframes that look most like these features.
  std::vector<int> alike(const matching::OrbFeatures& features, std::size_t most) const;
  // For each new keyframe, once; it must have been added. Answers once enough keyframes agree on the loop closure.
  std::optional<FoundLoop> look(LandmarkMap& map, int newest, const Pyramid& picture, const Motion& motion);
  // The least distance of two places that look the same, as far as is known; infinite where all that was seen is
  // unique.
  double repeats_m() const { return repeats_m_; }

 private:
  struct Claim {
    std::uint32_t serial;  // of the keyframe that makes it
    int session, earlier_session;
    View correction;
    Eigen::Vector3d centre;  // of that keyframe
    double scale;            // of what lies around it
    Eigen::Vector3d corrected(const Eigen::Vector3d& point) const {
      return correction * centre + scale * (correction * point - correction * centre);
    }
  };
  // What the claims of keyframes since `serial`, of the same sessions, say of one claim.
  struct Agreement {
    int agree = 0;
    double extent_m = 0.0;       // of where those stood that agree
    double rival_m = kUnique_m;  // how far off, at least, several others place the camera
  };
  Agreement agreement_with(const Claim& claim, std::uint32_t serial) const;
  Departure departure_of(const LandmarkMap& map, const FoundLoop& loop) const;
  std::optional<FoundLoop> compare(LandmarkMap& map, int newest, int earlier, const Pyramid& picture,
                                   const Motion& motion);
  matching::BinaryVocabulary vocabulary_;
  ClientOptions options_;
  matching::PlaceIndex index_;
  LandmarkFinder finder_;
  matching::BagOfWords last_bag_;
  std::deque<Claim> claims_;
  double repeats_m_ = kUnique_m;
};

// Of one session, or of two: keyframes in the order in which they were made.
std::vector<int> keyframes_in_order(const LandmarkMap& map, int session, int other);

// Along covisibility edges, metres from one keyframe to another; infinite where nothing leads there.
double path_between(const LandmarkMap& map, int from, int to);

// Keyframes of a session that belong together: by shared landmarks, or as neighbours in time where landmarks do not.
struct CovisibilityEdge {
  int from = 0, to = 0, landmarks = 0;  // from was made first
};
std::vector<CovisibilityEdge> covisibility_edges(const LandmarkMap& map, int session, int least_landmarks);

}  // namespace mapweave::visual
