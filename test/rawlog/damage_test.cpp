// Logs cut, flipped and lied about at every place: an Error or the clean end, never a crash, never more than the file
// holds.

#include "logs.h"

#include <mrpt/obs/CObservationBeaconRanges.h>
#include <mrpt/obs/CSensoryFrame.h>

#include <zlib.h>

#include <algorithm>
#include <random>

namespace mapweave::rawlog {
namespace {

using test::own_data;
using test::TemporaryFolder;
using ::testing::HasSubstr;

std::vector<Object> four_objects() {
  return {odometry(1.0, 1.0, 2.0, 0.3), scan(1.0), odometry(2.0, 1.5, 2.0, 0.3), scan(2.0)};
}

TEST(Damage, a_plain_log_cut_at_any_byte_gives_what_was_whole) {
  const TemporaryFolder folder;
  std::string bytes;
  std::vector<std::size_t> ends;
  for (const auto& object : four_objects()) ends.push_back((bytes += serialized(*object)).size());
  for (std::size_t cut = 1; cut < bytes.size(); ++cut) {
    const auto reading = read_all(write_bytes(folder / "cut.rawlog", bytes.substr(0, cut)));
    const auto whole =
        static_cast<std::size_t>(std::count_if(ends.begin(), ends.end(), [&](std::size_t end) { return end <= cut; }));
    ASSERT_EQ(reading.records.size(), whole) << "cut at " << cut;
    const bool at_a_boundary = std::count(ends.begin(), ends.end(), cut) == 1;
    ASSERT_EQ(reading.error == nullptr, at_a_boundary) << "cut at " << cut;
    if (reading.error) {
      ASSERT_EQ(reading.error->code(), ErrorCode::kCorrupt) << reading.error->what();
    }
  }
}

TEST(Damage, a_gz_log_cut_at_any_byte_is_an_error) {
  const TemporaryFolder folder;
  const std::string bytes = bytes_of(write_rawlog(folder / "whole.rawlog", four_objects()));
  for (std::size_t cut = 1; cut < bytes.size(); ++cut) {
    const auto reading = read_all(write_bytes(folder / "cut.rawlog", bytes.substr(0, cut)));
    ASSERT_TRUE(reading.error) << "cut at " << cut;
    if (cut > 1) {
      ASSERT_EQ(reading.error->code(), ErrorCode::kCorrupt) << reading.error->what();
    }
  }
}

TEST(Damage, a_gz_without_its_checksum_is_an_error_after_all_records) {
  const TemporaryFolder folder;
  const std::string bytes = bytes_of(write_rawlog(folder / "whole.rawlog", four_objects()));
  const auto reading = read_all(write_bytes(folder / "cut.rawlog", bytes.substr(0, bytes.size() - 8)));
  EXPECT_EQ(kinds(reading.records), "osos");
  EXPECT_THAT(reading.error, IsError(ErrorCode::kCorrupt, "checksum"));
}

TEST(Damage, a_flipped_bit_in_a_gz_is_noticed) {
  const TemporaryFolder folder;
  const std::string bytes = bytes_of(write_rawlog(folder / "whole.rawlog", four_objects()));
  const auto whole = read_all(folder / "whole.rawlog");
  std::mt19937_64 random(7);
  for (int i = 0; i < 300; ++i) {
    std::string damaged = bytes;
    const std::size_t place = 10 + random() % (bytes.size() - 10);  // the header's time and system do not matter
    damaged[place] = static_cast<char>(damaged[place] ^ (1 << random() % 8));
    const auto reading = read_all(write_bytes(folder / "flipped.rawlog", damaged));
    if (reading.error) continue;
    ASSERT_EQ(reading.records.size(), whole.records.size())
        << "byte " << place;  // a bit that fills up the last byte means nothing
    for (std::size_t k = 0; k < whole.records.size(); ++k)
      ASSERT_EQ(serialized(*reading.records[k].observation), serialized(*whole.records[k].observation));
  }
}

// Longer than the buffers: what the damage does to a record is seen long before the checksum.
std::vector<Object> a_minute() {
  std::mt19937_64 random(3);
  std::vector<Object> objects;
  for (int i = 0; i < 300; ++i) {
    std::vector<float> ranges(181);
    for (float& range : ranges) range = static_cast<float>(1 + random() % 4000) * 0.01F;
    objects.push_back(odometry(0.2 * i, 0.1 * i));
    objects.push_back(scan(0.2 * i, ranges));
  }
  return objects;
}

TEST(Damage, a_flipped_bit_in_a_gz_is_never_taken_for_a_wrong_clock_or_a_bad_object) {
  const TemporaryFolder folder;
  const std::string bytes = bytes_of(write_rawlog(folder / "whole.rawlog", a_minute()));
  std::mt19937_64 random(19);
  int seen_elsewhere = 0;
  for (int i = 0; i < 300; ++i) {
    std::string damaged = bytes;
    const std::size_t place = 10 + random() % (bytes.size() - 10);
    damaged[place] = static_cast<char>(damaged[place] ^ (1 << random() % 8));
    const auto reading = read_all(write_bytes(folder / "flipped.rawlog", damaged));
    if (!reading.error) continue;
    ASSERT_THAT(reading.error, IsError(ErrorCode::kCorrupt, "the gz "))
        << "byte " << place << ": " << reading.error->what();
    ASSERT_THAT(reading.error->remedy(), HasSubstr("copy the log again"));
    seen_elsewhere += std::string(reading.error->what()).find("first seen as: ") != std::string::npos;
  }
  EXPECT_GT(seen_elsewhere, 10);
}

TEST(Damage, no_message_shows_the_banner_of_mrpt) {
  const TemporaryFolder folder;
  std::string bytes;
  for (const auto& object : four_objects()) bytes += serialized(*object);
  int decoded_by_mrpt = 0;
  for (std::size_t place = 0; place < bytes.size(); ++place)
    for (const char bit : {'\x01', '\x40'}) {
      std::string damaged = bytes;
      damaged[place] = static_cast<char>(damaged[place] ^ bit);
      const auto reading = read_all(write_bytes(folder / "flipped.rawlog", damaged));
      const std::string text = reading.error ? reading.error->what() : "";
      decoded_by_mrpt += text.find("cannot be decoded") != std::string::npos;
      for (const char* banner : {"====", "Message:", "Exception while parsing", "Original exception"})
        ASSERT_EQ(text.find(banner), std::string::npos) << text;
    }
  EXPECT_GT(decoded_by_mrpt, 0);
}

TEST(Damage, a_wrong_clock_in_a_sound_gz_is_still_a_wrong_clock) {
  const TemporaryFolder folder;
  const auto reading = read_all(write_rawlog(folder / "back.rawlog", {scan(100.0), scan(50.0), scan(101.0)}));
  EXPECT_THAT(reading.error, IsError(ErrorCode::kBadInput, "time runs backwards"));
  EXPECT_EQ(std::string(reading.error->what()).find("gz"), std::string::npos);
}

TEST(Damage, a_flipped_bit_in_a_gz_of_text_is_named_too) {
  const TemporaryFolder folder;
  for (const char* name : {"carmen_old.log", "g2o_scans.g2o"}) {
    const std::string text = bytes_of(own_data(name));
    // Stored, not compressed: only the checksum shows it.
    const auto packed = folder / "packed.gz";
    gzFile file = gzopen(packed.c_str(), "wb0");
    ASSERT_NE(file, nullptr);
    gzwrite(file, text.data(), static_cast<unsigned>(text.size()));
    gzclose(file);
    std::string damaged = bytes_of(packed);
    const auto place = damaged.find("LASER", damaged.size() / 3);
    const auto digit = damaged.find_first_of("0123456789", damaged.find(' ', place));
    ASSERT_NE(digit, std::string::npos);
    damaged[digit] = 'x';
    const auto reading = read_all(write_bytes(folder / (std::string(name) + ".gz"), damaged));
    EXPECT_THAT(reading.error, IsError(ErrorCode::kCorrupt, "the gz is damaged"));
    EXPECT_THAT(reading.error->what(), HasSubstr("first seen as: 'x"));
  }
}

TEST(Damage, gz_members_may_follow_each_other_and_be_padded) {
  const TemporaryFolder folder;
  const std::string first = bytes_of(write_rawlog(folder / "a.rawlog", {scan(1.0)})),
                    second = bytes_of(write_rawlog(folder / "b.rawlog", {scan(2.0)}));
  const auto reading = read_all(write_bytes(folder / "both.rawlog", first + second + std::string(1000, '\0')));
  ASSERT_FALSE(reading.error) << reading.error->what();
  EXPECT_EQ(kinds(reading.records), "ss");
  EXPECT_THAT(read_all(write_bytes(folder / "litter.rawlog", first + "litter")).error,
              IsError(ErrorCode::kCorrupt, "gz"));
}

void flip_bits(const std::string& bytes, std::uint64_t seed, int times) {
  const TemporaryFolder folder;
  std::mt19937_64 random(seed);
  for (int i = 0; i < times; ++i) {
    std::string damaged = bytes;
    for (int flip = 0; flip < 3; ++flip) {
      char& byte = damaged[random() % damaged.size()];
      byte = static_cast<char>(byte ^ (1 << random() % 8));
    }
    read_all(write_bytes(folder / "flipped.rawlog", damaged));  // whatever comes, it comes as an Error
  }
}

TEST(Damage, flipped_bits_in_a_plain_log_never_crash) {
  std::string bytes;
  for (const auto& object : four_objects()) bytes += serialized(*object);
  flip_bits(bytes, 11, 1000);
}

TEST(Damage, flipped_bits_in_old_pairs_never_crash) {
  const TemporaryFolder folder;
  std::string bytes;
  mrpt::obs::CSensoryFrame frame;
  frame.insert(scan(1.0));
  bytes += serialized(frame);
  // The fixture, unpacked by hand: its objects as MRPT of 2006 wrote them.
  gzFile file = gzopen(own_data("rawlog_pairs.rawlog").c_str(), "rb");
  ASSERT_NE(file, nullptr);
  std::string old(100'000, '\0');
  old.resize(static_cast<std::size_t>(gzread(file, old.data(), 100'000)));
  gzclose(file);
  flip_bits(bytes + old, 13, 400);
}

TEST(Damage, sizes_that_cannot_be_are_refused_before_any_room_is_made) {
  const TemporaryFolder folder;
  std::string bytes = serialized(*scan(1.0));
  // The number of rays stands before the first range, 1.0f.
  const std::string five_rays = std::string("\x05\0\0\0", 4) + std::string("\0\0\x80\x3f", 4);
  const auto place = bytes.find(five_rays);
  ASSERT_NE(place, std::string::npos);
  const auto with_rays = [&](const std::string& count) { return std::string(bytes).replace(place, 4, count); };
  const auto huge = read_all(write_bytes(folder / "huge.rawlog", with_rays("\xff\xff\xff\xff")));
  EXPECT_THAT(huge.error, IsError(ErrorCode::kCorrupt, "announces 4294967295 rays"));
  EXPECT_THAT(huge.error->where(), HasSubstr("at byte " + std::to_string(place + 4)));
  const auto large = read_all(write_bytes(folder / "large.rawlog", with_rays(std::string("\0\0\x40\0", 4))));
  EXPECT_THAT(large.error, IsError(ErrorCode::kCorrupt, "cut short"));
}

// A motion whose estimate is said to be an object of another class: MRPT would make its room.
std::string motion_by(char version, const std::string& estimate) {
  return "\x96"
         "CActionRobotMovement2D" +
         (version + std::string("\1\0\0\0", 4)) + estimate + std::string(100, '\0');
}

TEST(Damage, a_motion_is_estimated_by_nothing_that_could_take_any_room) {
  const TemporaryFolder folder;
  const auto error_of = [&](char version, const std::string& estimate) {
    return read_all(write_bytes(folder / "a.rawlog", motion_by(version, estimate))).error;
  };
  const std::string matrix = std::string(
                                 "\x88"
                                 "CMatrixD\0",
                                 10) +
                             std::string("\4\0\0\0\0\x40\x44\6", 8);
  EXPECT_THAT(error_of(1, matrix), IsError(ErrorCode::kCorrupt, "its version 1 is not known"));
  EXPECT_THAT(error_of(7, matrix), IsError(ErrorCode::kCorrupt, "a matrix of 4 x 105136128"));
  const std::string particles = std::string(
      "\x91"
      "CPosePDFParticles\1\xff\xff\xff\xff",
      23);
  EXPECT_THAT(error_of(7, particles), IsError(ErrorCode::kCorrupt, "announces 4294967295 particles"));
  EXPECT_THAT(error_of(7, std::string("\x8c"
                                      "CPosePDFGrid\0",
                                      14)),
              IsError(ErrorCode::kCorrupt, "class 'CPosePDFGrid' and version 0, which is not known there"));
}

TEST(Damage, an_object_that_is_not_known_hides_none_behind_it) {
  const TemporaryFolder folder;
  mrpt::obs::CSensoryFrame frame;
  const auto beacons = std::make_shared<mrpt::obs::CObservationBeaconRanges>();
  beacons->timestamp = at(1.0);
  beacons->sensorLabel = "BEACONS";
  frame.insert(beacons);
  frame.insert(scan(1.0));
  std::string bytes = serialized(frame);
  EXPECT_EQ(kinds(read_all(write_bytes(folder / "whole.rawlog", bytes)).records), "?s");
  const auto place = bytes.find(std::string("\x05\0\0\0\0\0\x80\x3f", 8));
  ASSERT_NE(place, std::string::npos);
  bytes.replace(place, 4, "\xff\xff\xff\xff");
  EXPECT_THAT(read_all(write_bytes(folder / "rays.rawlog", bytes)).error,
              IsError(ErrorCode::kCorrupt, "announces 4294967295 rays"));
}

TEST(Damage, an_object_beyond_the_limit_is_refused) {
  const TemporaryFolder folder;
  ReadOptions options;
  options.max_object_mb = 0.001;
  const auto path = write_rawlog(folder / "a.rawlog", {scan(1.0, std::vector<float>(1000, 1.0f))});
  EXPECT_THAT(read_all(path, options).error, IsError(ErrorCode::kCorrupt, "1000 rays"));
}

TEST(Damage, text_logs_cut_at_any_byte_give_no_record_that_was_not_written) {
  const TemporaryFolder folder;
  for (const char* name : {"carmen_old.log", "carmen_new.log", "g2o_scans.g2o"}) {
    const std::string bytes = bytes_of(own_data(name));
    const auto whole = read_all(own_data(name));
    ASSERT_FALSE(whole.error);
    std::vector<double> written = seconds(whole.records);
    written.insert(written.end(),
                   {100.95, 101.4});  // the ODOM lines of carmen_old.log, used until the robot is seen to move
    for (std::size_t cut = 1; cut < bytes.size(); ++cut) {
      const auto reading = read_all(write_bytes(folder / name, bytes.substr(0, cut)));
      for (const double stamp : seconds(reading.records)) {
        ASSERT_TRUE(
            std::any_of(written.begin(), written.end(), [&](double known) { return std::abs(known - stamp) < 1e-9; }))
            << name << " cut at " << cut;
      }
    }
  }
}

TEST(Damage, a_class_that_cannot_be_made_is_refused) {
  const TemporaryFolder folder;
  EXPECT_THAT(read_all(write_bytes(folder / "a.rawlog", std::string("\x97mrpt::obs::CObservation\0\x88", 26))).error,
              IsError(ErrorCode::kUnsupported, "CObservation"));
}

}  // namespace
}  // namespace mapweave::rawlog
