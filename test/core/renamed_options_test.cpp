#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/core/files.h>
#include <mapweave/core/options.h>
#include <mapweave/core/renamed_options.h>

#include <support/temporary_folder.h>

#include <algorithm>

namespace mapweave {
namespace {

using testing::EndsWith;
using testing::HasSubstr;
using testing::IsEmpty;

struct AlignmentOptions {
  double longest_gap_s = 1.0, extrinsic_sigma_m = 0.02;
  template <class Visitor>
  void describe(Visitor& v) {
    v.positive("longest_gap_s", longest_gap_s, "longest gap");
    v.positive("extrinsic_sigma_m", extrinsic_sigma_m, "standard deviation");
  }
};

struct RunOptions {
  AlignmentOptions alignment;
  template <class Visitor>
  void describe(Visitor& v) {
    v.section("laser_camera_alignment", alignment, "alignment");
  }
};

class RenamedOptions : public testing::Test {
 protected:
  // What is logged while the layers are loaded.
  std::string notes_of(const std::string& text, const std::vector<std::string>& settings = {},
                       const std::vector<std::pair<std::string, std::string>>& environment = {}) {
    write_file(folder_ / "a.yaml", text);
    testing::internal::CaptureStderr();
    options_ = {};
    origins_ = load(options_, {{folder_ / "a.yaml"}, environment, settings});
    return testing::internal::GetCapturedStderr();
  }

  test::TemporaryFolder folder_;
  RunOptions options_;
  Origins origins_;
};

TEST_F(RenamedOptions, work_by_their_old_keys_in_a_file_with_a_note_for_each) {
  const std::string notes = notes_of("bind:\n  longest_gap_s: 3\n  tie_m: 0.5\n");
  EXPECT_EQ(options_.alignment.longest_gap_s, 3.0);
  EXPECT_EQ(options_.alignment.extrinsic_sigma_m, 0.5);
  EXPECT_THAT(notes, HasSubstr("a.yaml:1: 'bind' is now called 'laser_camera_alignment'"));
  EXPECT_THAT(notes, HasSubstr("a.yaml:3: 'tie_m' is now called 'laser_camera_alignment.extrinsic_sigma_m'"));
  EXPECT_EQ(std::count(notes.begin(), notes.end(), '\n'), 2) << notes;
  EXPECT_THAT(origins_.place_of("laser_camera_alignment.extrinsic_sigma_m"), EndsWith("a.yaml:3"));
}

TEST_F(RenamedOptions, work_by_their_old_keys_in_settings_with_one_note) {
  const std::string notes = notes_of("", {"bind.tie_m=0.5"});
  EXPECT_EQ(options_.alignment.extrinsic_sigma_m, 0.5);
  EXPECT_THAT(notes, HasSubstr("--set bind.tie_m=0.5: 'bind.tie_m' is now called "
                               "'laser_camera_alignment.extrinsic_sigma_m'"));
  EXPECT_EQ(std::count(notes.begin(), notes.end(), '\n'), 1) << notes;
  EXPECT_EQ(origins_.place_of("laser_camera_alignment.extrinsic_sigma_m"), "--set bind.tie_m=0.5");
}

TEST_F(RenamedOptions, work_by_their_old_names_in_the_environment_with_one_note) {
  const std::string notes = notes_of("", {}, {{"MAPWEAVE_BIND__TIE_M", "0.5"}});
  EXPECT_EQ(options_.alignment.extrinsic_sigma_m, 0.5);
  EXPECT_THAT(notes, HasSubstr("'MAPWEAVE_BIND__TIE_M' is now called "
                               "'MAPWEAVE_LASER_CAMERA_ALIGNMENT__EXTRINSIC_SIGMA_M'"));
  EXPECT_EQ(std::count(notes.begin(), notes.end(), '\n'), 1) << notes;
}

TEST_F(RenamedOptions, work_by_old_names_below_new_ones) {
  EXPECT_THAT(notes_of("laser_camera_alignment: {tie_m: 0.5}"), HasSubstr("a.yaml:1: 'tie_m' is now called"));
  EXPECT_EQ(options_.alignment.extrinsic_sigma_m, 0.5);
}

TEST_F(RenamedOptions, are_silent_by_their_new_keys) {
  EXPECT_THAT(notes_of("laser_camera_alignment: {extrinsic_sigma_m: 0.5}", {"laser_camera_alignment.longest_gap_s=3"}),
              IsEmpty());
}

TEST_F(RenamedOptions, are_refused_where_a_file_sets_both_names) {
  try {
    notes_of("laser_camera_alignment: {tie_m: 0.5, extrinsic_sigma_m: 0.6}");
    ADD_FAILURE();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("'tie_m' is the old name of 'extrinsic_sigma_m', which is set as well"));
  }
  testing::internal::GetCapturedStderr();
}

TEST_F(RenamedOptions, are_unknown_to_structs_without_the_new_name) {
  EXPECT_THROW(notes_of("tie_m: 0.5"), Error);
  testing::internal::GetCapturedStderr();
}

TEST(PresentKey, follows_sections_and_leaves_other_keys_alone) {
  EXPECT_EQ(present_key("bind.tie_m"), "laser_camera_alignment.extrinsic_sigma_m");
  EXPECT_EQ(present_key("rig.way.doubt_m"), "rig.trajectory.doubt_m");
  EXPECT_EQ(present_key("live.map_server.handlers"), "live.camera_map_server.handlers");
  EXPECT_EQ(present_key("visual.loops.witnesses"), "visual.loops.agreeing_keyframes");
  EXPECT_EQ(present_key("robots.0.edge"), "robots.0.edge");
  EXPECT_EQ(present_key("tie_m"), "tie_m");
}

}  // namespace
}  // namespace mapweave
