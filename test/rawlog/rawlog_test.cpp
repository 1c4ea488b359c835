#include "logs.h"

#include <mrpt/img/CImage.h>
#include <mrpt/io/CFileGZInputStream.h>
#include <mrpt/obs/CActionCollection.h>
#include <mrpt/obs/CActionRobotMovement2D.h>
#include <mrpt/obs/CObservationComment.h>
#include <mrpt/obs/CObservationImage.h>
#include <mrpt/obs/CObservationStereoImages.h>
#include <mrpt/obs/CSensoryFrame.h>
#include <support/pose_matchers.h>

namespace mapweave::rawlog {
namespace {

using test::IsNear;
using test::own_data;
using test::TemporaryFolder;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

Object movement(double x, double y, double heading, std::optional<double> stamp_s = {}) {
  mrpt::obs::CActionRobotMovement2D action;
  action.computeFromOdometry(mrpt::poses::CPose2D(x, y, heading), {});
  if (stamp_s) action.timestamp = at(*stamp_s);
  auto actions = std::make_shared<mrpt::obs::CActionCollection>();
  actions->insert(action);
  return actions;
}

Object frame(const std::vector<mrpt::obs::CObservation::Ptr>& observations) {
  auto made = std::make_shared<mrpt::obs::CSensoryFrame>();
  for (const auto& observation : observations) made->insert(observation);
  return made;
}

TEST(Rawlog, reads_observations_gz_or_not) {
  const TemporaryFolder folder;
  const std::vector<Object> objects = {odometry(10.0, 1.0, 2.0, 0.5), scan(10.1), scan(10.3)};
  const auto packed = read_all(write_rawlog(folder / "packed.rawlog", objects));
  const auto plain = read_all(write_rawlog(folder / "plain.rawlog", objects, false));
  ASSERT_FALSE(packed.error);
  ASSERT_FALSE(plain.error);
  ASSERT_EQ(kinds(packed.records), "oss");
  ASSERT_EQ(kinds(plain.records), "oss");
  for (std::size_t i = 0; i < objects.size(); ++i) {
    EXPECT_EQ(serialized(*packed.records[i].observation), serialized(*objects[i]));
    EXPECT_EQ(serialized(*plain.records[i].observation), serialized(*objects[i]));
  }
}

TEST(Rawlog, knows_how_far_it_has_read) {
  const TemporaryFolder folder;
  const auto path = write_rawlog(folder / "a.rawlog", {scan(1.0), scan(2.0)});
  const auto stream = open_log(path);
  EXPECT_EQ(stream->bytes_total(), std::filesystem::file_size(path));
  while (stream->next()) {}
  EXPECT_EQ(stream->bytes_read(), stream->bytes_total());
}

TEST(Rawlog, adds_up_the_increments_of_actions) {
  const TemporaryFolder folder;
  const auto path = write_rawlog(folder / "pairs.rawlog", {movement(1.0, 0.0, M_PI / 2), frame({scan(5.0)}),
                                                           movement(2.0, 0.0, 0.0), frame({scan(6.0)})});
  const auto reading = read_all(path);
  ASSERT_FALSE(reading.error);
  ASSERT_EQ(kinds(reading.records), "osos");
  EXPECT_THAT(seconds(reading.records), ElementsAre(5.0, 5.0, 6.0, 6.0));  // the stamp of the frame that follows
  EXPECT_THAT(odometry_of(reading.records[0]), IsNear(Pose2(1.0, 0.0, M_PI / 2), 1e-9, 1e-9));
  EXPECT_THAT(odometry_of(reading.records[2]), IsNear(Pose2(1.0, 2.0, M_PI / 2), 1e-9, 1e-9));
}

TEST(Rawlog, keeps_the_stamp_of_an_action_that_has_one) {
  const TemporaryFolder folder;
  const auto path =
      write_rawlog(folder / "pairs.rawlog", {movement(1.0, 0.0, 0.0, 4.9), frame({scan(5.0), scan(5.01)})});
  const auto reading = read_all(path);
  ASSERT_FALSE(reading.error);
  EXPECT_EQ(kinds(reading.records), "oss");
  EXPECT_NEAR(reading.records[0].stamp.seconds(), 4.9, 1e-9);
}

// Classes as MRPT wrote them in 2006: its own reader is the oracle.
TEST(Rawlog, reads_old_pairs_as_mrpt_does) {
  const auto path = own_data("rawlog_pairs.rawlog");
  std::vector<std::string> expected;
  mrpt::io::CFileGZInputStream file(path.string());
  auto archive = mrpt::serialization::archiveFrom(file);
  for (int i = 0; i < 7; ++i) {
    const auto object = archive.ReadObject();
    if (const auto pair = std::dynamic_pointer_cast<mrpt::obs::CSensoryFrame>(object)) {
      for (const auto& observation : *pair) expected.push_back(serialized(*observation));
    }
  }
  const auto reading = read_all(path);
  ASSERT_FALSE(reading.error) << reading.error->what();
  EXPECT_EQ(kinds(reading.records), "sososos");
  std::vector<std::string> scans;
  for (const auto& record : reading.records) {
    if (IS_CLASS(*record.observation, mrpt::obs::CObservation2DRangeScan))
      scans.push_back(serialized(*record.observation));
  }
  EXPECT_EQ(scans, expected);
}

TEST(Rawlog, reads_both_forms_of_a_public_log_alike) {
  MAPWEAVE_NEED_DATA(observations, "laser/intel/intel.rawlog");
  MAPWEAVE_NEED_DATA(pairs, "laser/intel/intel_sf.rawlog");
  const auto a = open_log(observations), b = open_log(pairs);
  std::optional<Pose2> a_origin, b_origin;
  std::uint64_t scans = 0;
  for (;;) {
    const auto left = a->next(), right = b->next();
    ASSERT_EQ(left.has_value(), right.has_value());
    if (!left) break;
    ASSERT_EQ(left->stamp, right->stamp);
    ASSERT_EQ(kinds({*left}), kinds({*right}));
    if (kinds({*left}) == "s") {
      ++scans;
      ASSERT_EQ(serialized(*left->observation), serialized(*right->observation));
    } else {
      if (!a_origin) {
        a_origin = odometry_of(*left);
        b_origin = odometry_of(*right);
      }
      ASSERT_THAT(between(*a_origin, odometry_of(*left)), IsNear(between(*b_origin, odometry_of(*right)), 1e-3, 1e-4));
    }
  }
  EXPECT_EQ(scans, 13631u);
}

TEST(Rawlog, passes_over_null_objects_and_comments) {
  const TemporaryFolder folder;
  auto comment = std::make_shared<mrpt::obs::CObservationComment>();
  comment->text = "recorded by nobody";
  comment->timestamp = at(1e9);
  auto with_null = std::make_shared<mrpt::obs::CSensoryFrame>();
  with_null->insert(scan(2.0));
  const auto reading =
      read_all(write_rawlog(folder / "a.rawlog", {nullptr, comment, scan(1.0), nullptr, with_null, nullptr}));
  ASSERT_FALSE(reading.error) << reading.error->what();
  EXPECT_EQ(kinds(reading.records), "ss");
}

TEST(Rawlog, survives_null_objects_within_frames_and_actions) {
  const TemporaryFolder folder;
  const std::string null_object = "\x87nullptr\x88";
  const std::string three("\x03\0\0\0", 4), one("\x01\0\0\0", 4);
  std::string bytes =
      "\x8d"
      "CSensoryFrame\x02" +
      three + null_object + serialized(*scan(1.0)) + null_object + "\x88";
  bytes += std::string(
               "\x91"
               "CActionCollection\0",
               19) +
           one + null_object + "\x88" + serialized(*scan(2.0));
  const auto reading = read_all(write_bytes(folder / "nulls.rawlog", bytes));
  ASSERT_FALSE(reading.error) << reading.error->what();
  EXPECT_EQ(kinds(reading.records), "ss");
}

TEST(Rawlog, names_an_unknown_class_and_its_place) {
  const TemporaryFolder folder;
  const std::string good = serialized(*scan(1.0));
  const auto path = write_bytes(folder / "future.rawlog", good +
                                                              "\x92"
                                                              "CObservationSmellX\x01 whatever");
  const auto reading = read_all(path);
  EXPECT_EQ(reading.records.size(), 1u);
  EXPECT_THAT(reading.error, IsError(ErrorCode::kUnsupported, "'CObservationSmellX'"));
  EXPECT_THAT(reading.error->where(), HasSubstr("future.rawlog at byte " + std::to_string(good.size())));
}

TEST(Rawlog, names_an_unknown_class_within_a_frame) {
  const TemporaryFolder folder;
  const std::string one("\x01\0\0\0", 4);
  const auto reading = read_all(write_bytes(folder / "future.rawlog",
                                            "\x8d"
                                            "CSensoryFrame\x02" +
                                                one +
                                                "\x92"
                                                "CObservationSmellX\x01 whatever"));
  EXPECT_THAT(reading.error, IsError(ErrorCode::kUnsupported, "'CObservationSmellX'"));
  EXPECT_THAT(reading.error->where(), HasSubstr("at byte 19"));
}

TEST(Rawlog, refuses_what_holds_no_observations) {
  const TemporaryFolder folder;
  EXPECT_THAT(read_all(write_rawlog(folder / "nulls.rawlog", {nullptr, nullptr})).error,
              IsError(ErrorCode::kBadInput, "no observations"));
  EXPECT_THAT(read_all(write_rawlog(folder / "gz_of_nothing.rawlog", {})).error,
              IsError(ErrorCode::kBadInput, "no observations"));
  EXPECT_THAT(read_all(write_bytes(folder / "empty.rawlog", "")).error, IsError(ErrorCode::kBadInput, "empty"));
}

TEST(Rawlog, says_why_a_file_cannot_be_opened) {
  const TemporaryFolder folder;
  EXPECT_THAT(read_all(folder / "nowhere.rawlog").error, IsError(ErrorCode::kMissing, "nowhere.rawlog"));
  EXPECT_THAT(read_all(folder.path()).error, IsError(ErrorCode::kUnsupported, "folder"));
  const auto unknown = read_all(write_bytes(folder / "picture.png", "\x89PNG and so on"));
  EXPECT_THAT(unknown.error, IsError(ErrorCode::kUnsupported, "MRPT rawlog"));
  EXPECT_THAT(unknown.error, IsError(ErrorCode::kUnsupported, "CARMEN log"));
  EXPECT_THAT(read_all(write_bytes(folder / "graph.g2o.zip", "PK\x03\x04")).error,
              IsError(ErrorCode::kUnsupported, "unzip"));
}

TEST(Rawlog, knows_the_format_by_content_before_the_extension) {
  const TemporaryFolder folder;
  EXPECT_EQ(kinds(read_all(write_rawlog(folder / "misnamed.log", {scan(1.0)})).records), "s");
}

TEST(Rawlog, refuses_observations_without_a_stamp) {
  const TemporaryFolder folder;
  auto unstamped = scan(1.0);
  unstamped->timestamp = INVALID_TIMESTAMP;
  EXPECT_THAT(read_all(write_rawlog(folder / "a.rawlog", {unstamped})).error,
              IsError(ErrorCode::kBadInput, "no time stamp"));
}

TEST(Rawlog, finds_pictures_in_the_folder_beside_the_log) {
  const TemporaryFolder folder;
  std::filesystem::create_directory(folder / "walk_Images");
  mrpt::img::CImage picture(4, 3, mrpt::img::CH_GRAY);
  picture.filledRectangle(0, 0, 3, 2, mrpt::img::TColor(77, 77, 77));
  ASSERT_TRUE(picture.saveToFile((folder / "walk_Images/left.png").string()));
  auto stereo = std::make_shared<mrpt::obs::CObservationStereoImages>();
  stereo->timestamp = at(1.0);
  stereo->hasImageRight = true;
  stereo->imageLeft.setExternalStorage("left.png");
  stereo->imageRight.setExternalStorage("right.png");
  auto mono = std::make_shared<mrpt::obs::CObservationImage>();
  mono->timestamp = at(2.0);
  mono->image.setExternalStorage("left.png");

  const auto base_before = mrpt::img::CImage::getImagesPathBase();
  const auto reading = read_all(write_rawlog(folder / "walk.rawlog", {stereo, mono}));
  ASSERT_FALSE(reading.error);
  ASSERT_EQ(reading.records.size(), 2u);
  EXPECT_EQ(mrpt::img::CImage::getImagesPathBase(), base_before);
  EXPECT_EQ(
      dynamic_cast<const mrpt::obs::CObservationImage&>(*reading.records[1].observation).image.getExternalStorageFile(),
      (folder / "walk_Images/left.png").string());
  load_pictures(*reading.records[1].observation);
  EXPECT_EQ(
      dynamic_cast<const mrpt::obs::CObservationImage&>(*reading.records[1].observation).image.at<std::uint8_t>(1, 1),
      77);
  try {
    load_pictures(*reading.records[0].observation);
    FAIL() << "the right picture is missing";
  } catch (const Error& error) {
    EXPECT_EQ(error.code(), ErrorCode::kMissing);
    EXPECT_THAT(error.what(), HasSubstr("walk_Images/right.png"));
  }
}

TEST(Stamps, survive_a_round_trip_through_mrpt) {
  for (const std::int64_t ns : {0LL, 100LL, -100LL, 976052857337530000LL, 1031745824658000000LL}) {
    EXPECT_EQ(to_stamp(to_mrpt_time(Stamp{ns})).ns, ns);
  }
  EXPECT_EQ(to_stamp(to_mrpt_time(Stamp{149})).ns, 100);
  EXPECT_EQ(to_stamp(to_mrpt_time(Stamp{-149})).ns, -100);
  EXPECT_FALSE(has_stamp(INVALID_TIMESTAMP));
}

}  // namespace
}  // namespace mapweave::rawlog
