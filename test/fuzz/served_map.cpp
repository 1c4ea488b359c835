// Maps as map_server has them: the description (YAML), and the image (PGM, PNG).

#include "fuzz_target.h"

#include <exporters/small_map.h>
#include <grey_image.h>
#include <mapweave/exporters/map_server.h>

#include <opencv2/imgcodecs.hpp>

namespace mapweave::fuzz {
namespace {

using namespace exporters;

OccupancyGrid corner() {
  return test::drawn_grid({"####",  //
                           "#.. ",  //
                           "#.  "},
                          0.1, -3.2, 1.7);
}

// A grid that was read is written, and read as the same.
void read_and_write(const std::filesystem::path& yaml) {
  const OccupancyGrid grid = read_map_server(yaml);
  expect(grid.log_odds.size() == static_cast<std::size_t>(grid.columns) * static_cast<std::size_t>(grid.rows),
         "a grid has its cells");
  identity_of_map_server(yaml);
  if (grid.log_odds.empty()) return;
  scratch_file("again.pgm", pgm_bytes(grid));
  const OccupancyGrid again = read_map_server(scratch_file("again.yaml", map_server_yaml(grid, "again.pgm")));
  expect(again.columns == grid.columns && again.rows == grid.rows, "a grid comes back as large as it was");
}

void read_description(std::string_view bytes) {
  scratch_file("m.pgm", pgm_bytes(corner()));
  read_and_write(scratch_file("m.yaml", bytes));
}

void read_image(std::string_view bytes) {
  const MapServerImage image = decode_image(bytes, kWhere);
  const auto pixels = static_cast<std::size_t>(image.columns) * static_cast<std::size_t>(image.rows);
  expect(image.shades.size() == pixels && (image.transparent.empty() || image.transparent.size() == pixels),
         "an image has its pixels");
}

std::string packed(const cv::Mat& image, const std::string& extension) {
  std::vector<unsigned char> bytes;
  cv::imencode(extension, image, bytes);
  return {bytes.begin(), bytes.end()};
}

const std::vector<Kind>& kinds() {
  static const std::vector<Kind> all = {
      {read_description,
       {map_server_yaml(corner(), "m.pgm"),
        "image: m.pgm\nmode: scale\nresolution: 0.05\norigin: [1.5, -2, 0.3]\nnegate: 1\noccupied_thresh: 0.7\n"
        "free_thresh: 0.2\n"}},
      {read_image,
       {pgm_bytes(corner()), "P2\n# a comment\n3 2\n15\n0 1 2 3 4 15\n", "P5 2 1 65535\n" + std::string("\0\1\2\3", 4),
        packed(cv::Mat(2, 3, CV_8UC4, cv::Scalar(1, 2, 3, 4)), ".png"), packed(cv::Mat(2, 3, CV_16UC1, 500), ".png")}}};
  return all;
}

}  // namespace

std::vector<std::string> seeds() { return seeds_of(kinds()); }
void decode(std::string_view bytes) { decode_one_of(kinds(), bytes); }

}  // namespace mapweave::fuzz
