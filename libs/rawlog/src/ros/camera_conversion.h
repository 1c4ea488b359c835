#pragma once
// Pictures of one camera, a stereo pair or a depth camera become observations.

#include "../record_source.h"
#include "fisheye.h"
#include "messages.h"
#include "picture_messages.h"
#include "topic_choice.h"

#include <deque>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace mapweave::rawlog::ros {

// What is known of a picture beside its pixels.
struct PictureOrigin {
  Stamp stamp;
  std::string frame;
  Pose3 robot_from_camera;  // optical axes: x right, y down, z ahead
  std::uint64_t place = 0;
};

// Pictures of a pair are matched one-to-one, nearest first, closer than `max_pair_s`. Depth belongs to the colour
// picture where both are of one frame and size (registered); else they become observations of their own. For one
// thread.
class CameraConversion {
 public:
  // `bag`: for messages.
  CameraConversion(BagCamera camera, double max_pair_s, std::string bag);

  const BagCamera& camera() const { return camera_; }
  // Whether pictures of `topic` (an index into ChosenTopics::topics) lack a calibration that has a topic.
  bool awaits_calibration(std::size_t topic) const;
  void calibrate(std::size_t topic, const CameraInfoMessage& message);

  // Appends what is complete. Throws Error for what cannot be decoded.
  void add(std::size_t topic, MessageReader& reader, PictureForm form, PictureOrigin origin,
           std::vector<PlacedRecord>& records);
  // The bag ends.
  void finish(std::vector<PlacedRecord>& records);

 private:
  struct Side {
    std::optional<mrpt::img::TCamera> calibration;
    CameraInfoMessage rectification;  // of a stereo pair; its views are not used
    std::optional<FisheyeLens> lens;  // whose pictures are rectified
  };
  struct Picture {
    PictureOrigin origin;
    mrpt::img::CImage image;
    mrpt::math::CMatrix_u16 depth;
  };

  bool is_second(std::size_t topic) const;
  Picture decoded(bool second, MessageReader& reader, PictureForm form);
  void expect_optical_axes(const CloudPoints& points);
  void set_lens(Side& side, const std::array<double, 4>& fisheye) const;
  bool is_depth(bool second) const { return second && camera_.kind == BagCameraKind::depth; }
  void match(bool is_last, std::vector<PlacedRecord>& records);
  void make(Picture& first, Picture& second, std::vector<PlacedRecord>& records);
  void make_single(Picture& picture, bool second, std::vector<PlacedRecord>& records);
  void make_pair(Picture& left, Picture& right, std::vector<PlacedRecord>& records);
  void make_depth(Picture* colour, Picture& depth, std::vector<PlacedRecord>& records);
  Pose3 left_from_right(const Picture& left, const Picture& right) const;
  mrpt::img::TCamera calibration_of(bool second, std::size_t columns, std::size_t rows) const;
  void drop(std::deque<Picture>& pictures);

  BagCamera camera_;
  std::int64_t window_ns_;
  std::string bag_;
  Side sides_[2];
  std::deque<Picture> waiting_[2];
  bool is_apart_ = false;        // depth that is not registered
  bool has_known_axes_ = false;  // clouds
  std::uint64_t unpaired_ = 0, paired_ = 0;
};

}  // namespace mapweave::rawlog::ros
