// Hostile cameras within rawlogs: sizes that cannot be are refused before MRPT makes room for them.
#include "camera_folders.h"

#include <mapweave/rawlog/depth_delay.h>
#include <sys/resource.h>

#include <cstring>
#include <random>

namespace mapweave::rawlog {
namespace {

using test::TemporaryFolder;

mrpt::img::CImage image_of(int type) { return mrpt::img::CImage(picture(1, type), mrpt::img::DEEP_COPY); }

std::vector<std::pair<std::string, Object>> camera_objects() {
  auto grey = std::make_shared<mrpt::obs::CObservationImage>();
  grey->timestamp = at(1.0);
  grey->sensorLabel = "grey";
  grey->image = image_of(CV_8UC1);
  auto colour = std::make_shared<mrpt::obs::CObservationImage>(*grey);
  colour->image = image_of(CV_8UC3);
  auto outside = std::make_shared<mrpt::obs::CObservationImage>(*grey);
  outside->image.setExternalStorage("somewhere/else.png");
  auto stereo = std::make_shared<mrpt::obs::CObservationStereoImages>();
  stereo->timestamp = at(1.0);
  stereo->imageLeft = stereo->imageRight = stereo->imageDisparity = image_of(CV_8UC1);
  stereo->hasImageRight = stereo->hasImageDisparity = true;
  auto depth = std::make_shared<mrpt::obs::CObservation3DRangeScan>();
  depth->timestamp = at(1.0);
  depth->hasIntensityImage = depth->hasRangeImage = depth->hasPoints3D = depth->hasConfidenceImage = true;
  depth->intensityImage = image_of(CV_8UC3);
  depth->confidenceImage = image_of(CV_8UC1);
  depth->resizePoints3DVectors(5);
  depth->rangeImage_setSize(kRows, kColumns);
  depth->rangeImage.fill(1);
  depth->cameraParams.ncols = kColumns;
  depth->cameraParams.nrows = kRows;
  set_depth_delay_ns(*depth, 7'000'000);
  auto imu = std::make_shared<mrpt::obs::CObservationIMU>();
  imu->timestamp = at(1.0);
  return {{"grey", grey}, {"colour", colour}, {"outside", outside}, {"stereo", stereo}, {"depth", depth}, {"imu", imu}};
}

// What is allocated at once beyond this fails.
class LittleMemory {
 public:
  LittleMemory() {
#if !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
    std::uint64_t pages = 0;
    std::ifstream("/proc/self/statm") >> pages;
    ::getrlimit(RLIMIT_AS, &before_);
    rlimit limit = before_;
    limit.rlim_cur = pages * 4096 + (64 << 20);
    ::setrlimit(RLIMIT_AS, &limit);
    is_limited_ = true;
#endif
  }
  ~LittleMemory() {
    if (is_limited_) ::setrlimit(RLIMIT_AS, &before_);
  }

 private:
  rlimit before_{};
  bool is_limited_ = false;
};

TEST(CameraObjects, are_read_as_they_were_written) {
  const TemporaryFolder folder;
  for (const auto& [name, object] : camera_objects()) {
    const auto reading = read_all(write_rawlog(folder / "one.rawlog", {object, scan(2.0)}));
    ASSERT_EQ(reading.error, nullptr) << name << ": " << reading.error->what();
    EXPECT_EQ(reading.records.size(), 2u) << name;
  }
}

TEST(CameraObjects, sizes_that_cannot_be_never_make_room) {
  const TemporaryFolder folder;
  ReadOptions options;
  options.max_object_mb = 1.0;
  for (const auto& [name, object] : camera_objects()) {
    const std::string bytes = serialized(*object);
    for (std::size_t place = 0; place + 4 <= bytes.size(); ++place) {
      std::uint32_t value = 0;
      std::memcpy(&value, bytes.data() + place, sizeof value);
      if (value > kRows * kColumns * 3 || (value == 0 && place % 7 != 0))
        continue;  // no length that was written; few of the zeros are
      for (const char* length : {"\xff\xff\xff\x7f", "\xf0\xff\xff\xff"}) {
        const std::string damaged = std::string(bytes).replace(place, 4, length, 4);
        write_bytes(folder / "hostile.rawlog", damaged);
        const LittleMemory limit;
        const auto reading = read_all(folder / "hostile.rawlog", options);
        if (!reading.error) continue;
        ASSERT_EQ(std::string(reading.error->what()).find("memory"), std::string::npos)
            << name << " at byte " << place << ": " << reading.error->what();
      }
    }
  }
}

TEST(CameraObjects, cut_short_at_any_byte_are_an_error) {
  const TemporaryFolder folder;
  for (const auto& [name, object] : camera_objects()) {
    const std::string bytes = serialized(*object);
    for (std::size_t cut = 1; cut<bytes.size(); cut += cut> 300 && cut + 300 < bytes.size() ? 197 : 7)
      ASSERT_THAT(read_all(write_bytes(folder / "cut.rawlog", bytes.substr(0, cut))).error,
                  IsError(ErrorCode::kCorrupt, ""))
          << name << cut;
  }
}

TEST(CameraObjects, flipped_bits_never_crash) {
  const TemporaryFolder folder;
  std::mt19937_64 random(17);
  for (const auto& [name, object] : camera_objects()) {
    const std::string bytes = serialized(*object);
    for (int i = 0; i < 50; ++i) {
      std::string damaged = bytes;
      char& byte = damaged[random() % damaged.size()];
      byte = static_cast<char>(byte ^ (1 << random() % 8));
      read_all(write_bytes(folder / "flipped.rawlog", damaged));
    }
  }
}

TEST(CameraObjects, a_picture_larger_than_its_bytes_is_refused) {
  const TemporaryFolder folder;
  const std::string bytes = serialized(*camera_objects().front().second);
  const std::string size("\x20\0\0\0\x18\0\0\0", 8);
  const auto place = bytes.find(size);
  ASSERT_NE(place, std::string::npos);
  const auto with_size = [&](const std::string& columns_and_rows) {
    return read_all(write_bytes(folder / "a.rawlog", std::string(bytes).replace(place, 8, columns_and_rows))).error;
  };
  EXPECT_THAT(with_size(std::string("\xff\xff\0\0\xff\xff\0\0", 8)), IsError(ErrorCode::kCorrupt, "65535 x 65535"));
  EXPECT_THAT(with_size(std::string("\x21\0\0\0\x18\0\0\0", 8)),
              IsError(ErrorCode::kCorrupt, "announces 768 bytes for 33 x 24 pixels"));
}

}  // namespace
}  // namespace mapweave::rawlog
