#include "small_map.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/exporters/grid_image.h>
#include <mapweave/exporters/map_server.h>
#include <support/data.h>
#include <support/temporary_folder.h>
#include <opencv2/imgcodecs.hpp>

#include <algorithm>
#include <fstream>

namespace mapweave::exporters {
namespace {

using test::drawn_grid;
using test::letters_of;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

const OccupancyGrid kCorner = drawn_grid({"####",  //
                                          "#.. ",  //
                                          "#.  "},
                                         0.1, -3.2, 1.7);

// Without write_file's care for the disk: these tests write thousands of files.
void put(const std::filesystem::path& path, std::string_view bytes) {
  std::ofstream file(path, std::ios::binary | std::ios::trunc);
  file.write(bytes.data(), static_cast<std::streamsize>(bytes.size()));
  ASSERT_TRUE(file.flush());
}

class MapServer : public testing::Test {
 protected:
  // Writes the YAML and an image, reads the map.
  OccupancyGrid read(const std::string& yaml, const std::string& image, const std::string& image_name = "m.pgm") {
    put(folder_ / image_name, image);
    put(folder_ / "m.yaml", yaml);
    return read_map_server(folder_ / "m.yaml");
  }
  std::string complaint_about(const std::string& yaml, const std::string& image = "P5\n1 1\n255\nx") {
    try {
      read(yaml, image);
    } catch (const Error& error) {
      code_ = error.code();
      return error.what();
    }
    return "no complaint";
  }
  test::TemporaryFolder folder_;
  ErrorCode code_ = ErrorCode::kInternal;
};

constexpr const char* kPlain = "image: m.pgm\nresolution: 0.1\n";

TEST_F(MapServer, files_are_what_map_server_and_nav2_load) {
  write_map_server(kCorner, folder_.path(), "map");
  EXPECT_EQ(read_file(folder_ / "map.yaml"),
            "image: map.pgm\nmode: trinary\nresolution: 0.1\norigin: [-3.2, 1.7, 0]\nnegate: 0\noccupied_thresh: "
            "0.65\nfree_thresh: 0.196\n");
  EXPECT_EQ(read_file(folder_ / "map.pgm"),
            std::string("P5\n4 3\n255\n") + std::string("\x00\x00\x00\x00\x00\xfe\xfe\xcd\x00\xfe\xcd\xcd", 12));
}

TEST_F(MapServer, files_read_back_as_the_same_grid) {
  write_map_server(kCorner, folder_.path(), "map");
  const auto grid = read_map_server(folder_ / "map.yaml");
  EXPECT_EQ(letters_of(grid), letters_of(kCorner));
  EXPECT_EQ(grid.resolution_m, kCorner.resolution_m);
  EXPECT_EQ(grid.origin_x_m, kCorner.origin_x_m);
  EXPECT_EQ(grid.origin_y_m, kCorner.origin_y_m);
}

TEST_F(MapServer, our_png_serves_as_well) {
  const auto grid = read("image: m.png\nresolution: 0.1\norigin: [-3.2, 1.7, 0.0]\n", grid_png(kCorner), "m.png");
  EXPECT_EQ(letters_of(grid), letters_of(kCorner));
}

// The share of occupation of shade s is (255 - s) / 255: 0x59 is 0.651, 0x5a 0.647, 127 0.502, 205 0.19608.
const std::string kShades("P5\n6 1\n255\n\x00\x59\x5a\x7f\xcd\xff", 17);

TEST_F(MapServer, trinary_knows_walls_free_floor_and_nothing_between) {
  EXPECT_THAT(letters_of(read(kPlain, kShades)), ElementsAre("##   ."));
  EXPECT_THAT(letters_of(read(std::string(kPlain) + "free_thresh: 0.25\n", kShades)), ElementsAre("##  .."));
  EXPECT_THAT(letters_of(read(std::string(kPlain) + "occupied_thresh: 0.5\n", kShades)), ElementsAre("#### ."));
}

TEST_F(MapServer, negate_takes_white_for_walls) {
  EXPECT_THAT(letters_of(read(std::string(kPlain) + "negate: 1\n", kShades)), ElementsAre(".   ##"));
  EXPECT_THAT(letters_of(read(std::string(kPlain) + "negate: true\n", kShades)), ElementsAre(".   ##"));
}

TEST_F(MapServer, scale_keeps_the_shades_between) {
  const auto grid = read(std::string(kPlain) + "mode: scale\n", std::string("P5\n5 1\n255\n\x00\x60\x94\xa0\xff", 16));
  EXPECT_EQ(grid.log_odds.front(), kServedLogOdds);
  EXPECT_EQ(grid.log_odds.back(), -kServedLogOdds);
  EXPECT_GT(grid.log_odds[1], grid.log_odds[2]);
  EXPECT_GT(grid.log_odds[2], grid.log_odds[3]);
  EXPECT_LT(std::abs(probability(grid.log_odds[2]) - 0.5), 0.02);  // 0x94: half way between the thresholds
}

TEST_F(MapServer, raw_shades_are_hundredths) {
  const auto grid = read(std::string(kPlain) + "mode: raw\n", std::string("P5\n5 1\n255\n\x00\x14\x50\x64\x65", 16));
  EXPECT_EQ(grid.log_odds[0], -kServedLogOdds);
  EXPECT_NEAR(probability(grid.log_odds[1]), 0.2, 0.01);
  EXPECT_NEAR(probability(grid.log_odds[2]), 0.8, 0.01);
  EXPECT_EQ(grid.log_odds[3], kServedLogOdds);
  EXPECT_EQ(grid.log_odds[4], OccupancyGrid::kUnknown);
}

TEST_F(MapServer, reads_pgm_as_text_with_comments_and_with_16_bits) {
  EXPECT_THAT(letters_of(read(kPlain, "P2 # by hand\n# two rows\n3 2\n10\n0 10 5\n10 10 0\n")),
              ElementsAre("#. ", "..#"));
  EXPECT_THAT(letters_of(read(kPlain, std::string("P5 2 1 65535\n\x00\x10\xff\x00", 17))), ElementsAre("#."));
}

TEST_F(MapServer, averages_colours_and_hides_transparent_pixels_in_scale_mode) {
  cv::Mat image(1, 3, CV_8UC4, cv::Scalar(0, 0, 0, 255));
  image.at<cv::Vec4b>(0, 1) = {255, 255, 255, 255};
  image.at<cv::Vec4b>(0, 2) = {0, 0, 0, 10};
  std::vector<std::uint8_t> png;
  ASSERT_TRUE(cv::imencode(".png", image, png));
  const std::string bytes(png.begin(), png.end());
  const std::string yaml = "image: m.png\nresolution: 0.1\n";
  EXPECT_THAT(letters_of(read(yaml, bytes, "m.png")), ElementsAre("#.#"));
  EXPECT_THAT(letters_of(read(yaml + "mode: scale\n", bytes, "m.png")), ElementsAre("#. "));
}

TEST_F(MapServer, turns_the_map_by_the_yaw_of_its_origin) {
  // Lower left at (1, 2), turned to the left by a quarter: the image's right is the map's up.
  const std::string image("P5\n3 2\n255\n\x00\xff\xcd\xff\xff\x00", 17);
  const auto grid = read("image: m.pgm\nresolution: 1\norigin: [1, 2, 1.5707963267948966]\n", image);
  EXPECT_THAT(letters_of(grid), ElementsAre(" #", "..", "#."));
  EXPECT_NEAR(grid.origin_x_m, -1.0, 1e-9);
  EXPECT_NEAR(grid.origin_y_m, 2.0, 1e-9);
}

TEST_F(MapServer, turned_by_any_yaw_keeps_its_area_and_place) {
  const auto hall = drawn_grid(std::vector<std::string>(60, std::string(80, '.')), 0.1);
  put(folder_ / "m.pgm", pgm_bytes(hall));
  for (const double yaw : {0.3, -1.0, 2.5, 10.0}) {
    put(folder_ / "m.yaml", "image: m.pgm\nresolution: 0.1\norigin: [5, -7, " + std::to_string(yaw) + "]\n");
    const auto grid = read_map_server(folder_ / "m.yaml");
    EXPECT_NEAR(static_cast<double>(
                    std::count_if(grid.log_odds.begin(), grid.log_odds.end(), [](std::int16_t l) { return l < 0; })),
                4800.0, 60.0);
    // The middle of the hall, (4, 3) from its corner.
    const Pose2 middle = compose(Pose2(5.0, -7.0, yaw), Pose2(4.0, 3.0, 0.0));
    EXPECT_LT(grid.at(static_cast<std::int32_t>((middle.x - grid.origin_x_m) / 0.1),
                      static_cast<std::int32_t>((middle.y - grid.origin_y_m) / 0.1)),
              0);
  }
}

TEST_F(MapServer, needs_no_more_than_image_and_resolution) {
  const auto grid = read("resolution: 0.05\nimage: m.pgm\nframe: somewhere\n", "P2 1 1 255 0");
  EXPECT_EQ(letters_of(grid), std::vector<std::string>{"#"});
  EXPECT_EQ(grid.origin_x_m, 0.0);
}

TEST_F(MapServer, names_file_line_and_remedy_of_what_makes_no_map) {
  EXPECT_THAT(complaint_about("image: other.pgm\nresolution: 0.1\n"), HasSubstr("m.yaml:1: the image '"));
  EXPECT_EQ(code_, ErrorCode::kMissing);
  EXPECT_THAT(complaint_about("resolution: 0.1\n"), HasSubstr("the key 'image' is missing"));
  EXPECT_EQ(code_, ErrorCode::kMissing);
  EXPECT_THAT(complaint_about("image: m.pgm\n"), HasSubstr("the key 'resolution' is missing"));
  for (const char* resolution : {"0", "-0.05", ".nan", ".inf", "1e9", "five", "[1]", "~"}) {
    EXPECT_THAT(complaint_about("image: m.pgm\nresolution: " + std::string(resolution) + "\n"),
                HasSubstr("m.yaml:2: 'resolution'"))
        << resolution;
    EXPECT_EQ(code_, ErrorCode::kBadInput);
  }
  for (const char* origin :
       {"[.nan, 0, 0]", "[0]", "[0, 0]", "[0, 0, 0, 0]", "3", "[a, 0, 0]", "[1e300, 0, 0]", "{x: 1}"})
    EXPECT_THAT(complaint_about(std::string(kPlain) + "origin: " + origin + "\n"), HasSubstr("m.yaml:3: 'origin'"))
        << origin;
  EXPECT_THAT(complaint_about(std::string(kPlain) + "occupied_thresh: 65\n"), HasSubstr("it must lie in 0..1"));
  EXPECT_THAT(complaint_about(std::string(kPlain) + "free_thresh: 0.7\n"), HasSubstr("below 'occupied_thresh'"));
  EXPECT_THAT(complaint_about(std::string(kPlain) + "mode: fancy\n"), HasSubstr("trinary, scale or raw"));
  EXPECT_THAT(complaint_about(std::string(kPlain) + "negate: 2\n"), HasSubstr("'negate' must be 0 or 1"));
  EXPECT_THAT(complaint_about("image: [m.pgm\n"), HasSubstr("no valid YAML"));
  EXPECT_THAT(complaint_about("just text"), HasSubstr("no map's description"));
  EXPECT_THAT(complaint_about(""), HasSubstr("no map's description"));
  EXPECT_THAT(complaint_about(std::string(100000, '[')), HasSubstr("m.yaml:1"));
  EXPECT_THROW(read_map_server(folder_ / "absent.yaml"), Error);
}

TEST_F(MapServer, a_key_that_comes_twice_is_refused) {
  EXPECT_THAT(complaint_about(std::string(kPlain) + "resolution: 0.05\n"),
              HasSubstr("m.yaml:3: the key 'resolution' comes twice"));
  EXPECT_EQ(code_, ErrorCode::kBadInput);
}

TEST_F(MapServer, is_not_fooled_by_sizes_in_a_header) {
  EXPECT_THAT(complaint_about(kPlain, "P5\n40000 40000\n255\nabc"), HasSubstr("40000 x 40000 pixels; up to"));
  const std::string too_large = complaint_about(kPlain, "P5\n20000 20000\n255\nabc");
  EXPECT_THAT(too_large, HasSubstr("20000 x 20000 pixels; up to 268435456 can be read"));
  EXPECT_THAT(too_large, HasSubstr("scale it down and multiply the key 'resolution' by the same factor"));
  EXPECT_THAT(complaint_about(kPlain, "P5\n10000 10000\n255\nabc"), HasSubstr("cut short"));
  EXPECT_THAT(complaint_about(kPlain, "P2\n10000 10000\n255\n1 2 3"), HasSubstr("cut short"));
  EXPECT_THAT(complaint_about(kPlain, "P5\n99999999999999999999 1\n255\nabc"), HasSubstr("larger than"));
  EXPECT_THAT(complaint_about(kPlain, "P5\n0 5\n255\n"), HasSubstr("no pixels"));
  EXPECT_THAT(complaint_about(kPlain, "P5\n-3 5\n255\n"), HasSubstr("something else stands where the width should be"));
  EXPECT_THAT(complaint_about(kPlain, "P5\n1 1\n0\nx"), HasSubstr("largest shade is 0"));
  EXPECT_THAT(complaint_about(kPlain, "P5\n1 1\n70000\nxx"), HasSubstr("larger than 65535"));
  EXPECT_THAT(complaint_about(kPlain, "P5\n1 1\n255\nabcdef"), HasSubstr("5 bytes more"));
  EXPECT_THAT(complaint_about(kPlain, "P2\n2 1\n255\n1 999"), HasSubstr("larger than 255"));
  EXPECT_THAT(complaint_about(kPlain, "P6\n1 1\n255\nabc"), HasSubstr("neither PGM"));
  EXPECT_EQ(code_, ErrorCode::kUnsupported);
  EXPECT_THAT(complaint_about(kPlain, ""), HasSubstr("the image is empty"));

  std::string png = grid_png(kCorner);
  png[16] = '\x7f';  // two thousand million columns
  EXPECT_THAT(complaint_about(kPlain, png), HasSubstr("pixels; up to"));
}

TEST_F(MapServer, image_cut_at_any_byte_is_an_error) {
  for (const std::string& whole : {pgm_bytes(kCorner), grid_png(kCorner), std::string("P2\n2 2\n255\n0 254 205 0")}) {
    put(folder_ / "m.yaml", kPlain);
    put(folder_ / "m.pgm", whole);
    ASSERT_FALSE(read_map_server(folder_ / "m.yaml").empty());
    for (std::size_t size = 0; size < whole.size(); ++size) {
      // A number as text may lose its last digits unseen.
      if (whole[1] == '2' && size >= whole.find_last_of(' ') + 1) continue;
      put(folder_ / "m.pgm", std::string_view(whole).substr(0, size));
      EXPECT_THROW(read_map_server(folder_ / "m.yaml"), Error) << whole.substr(0, 2) << " cut at " << size;
    }
  }
}

TEST_F(MapServer, damaged_png_is_an_error_or_a_grid_of_its_size) {
  const std::string whole = grid_png(kCorner);
  put(folder_ / "m.yaml", kPlain);
  for (std::size_t i = 0; i < whole.size(); ++i) {
    std::string damaged = whole;
    damaged[i] = static_cast<char>(damaged[i] ^ 0x55);
    put(folder_ / "m.pgm", damaged);
    try {
      const auto grid = read_map_server(folder_ / "m.yaml");
      EXPECT_EQ(grid.log_odds.size(), static_cast<std::size_t>(grid.columns) * static_cast<std::size_t>(grid.rows));
    } catch (const Error&) {}
  }
}

TEST_F(MapServer, reads_a_halmstad_map_whose_unknown_is_127) {
  MAPWEAVE_NEED_DATA(image, "laser/mapmerge_halmstad/HIH/HIH_01.png");
  put(folder_ / "m.yaml", "image: " + std::filesystem::absolute(image).string() + "\nresolution: 0.02\n");
  const auto grid = read_map_server(folder_ / "m.yaml");
  EXPECT_EQ(grid.columns, 1585);
  EXPECT_EQ(grid.rows, 1585);
  const auto share = [&](auto&& is) {
    return static_cast<double>(std::count_if(grid.log_odds.begin(), grid.log_odds.end(), is)) /
           static_cast<double>(grid.log_odds.size());
  };
  EXPECT_GT(share([](std::int16_t l) { return l == 0; }), 0.5);
  EXPECT_GT(share([](std::int16_t l) { return l < 0; }), 0.02);
  EXPECT_GT(share([](std::int16_t l) { return l > 0; }), 0.002);
}

}  // namespace
}  // namespace mapweave::exporters
