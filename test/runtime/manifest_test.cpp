#include <mapweave/runtime/manifest.h>

#include <gmock/gmock.h>
#include <mapweave/core/files.h>
#include <support/temporary_folder.h>
#include <nlohmann/json.hpp>

namespace mapweave::runtime {
namespace {

TEST(Manifest, holds_the_checksum_of_every_file_and_keeps_those_with_times_apart) {
  test::TemporaryFolder folder;
  std::filesystem::create_directories(folder / "team");
  write_file(folder / "team" / "map.png", "a picture");
  write_file(folder / "summary.json", "{}");
  write_file(folder / "manifest.json", "of before");
  const auto manifest = manifest_json("run", 7, {{"alpha.rawlog", hash_of_bytes("a log")}}, folder.path());
  EXPECT_EQ(manifest["outputs"].size(), 1u);
  EXPECT_EQ(manifest["outputs"]["team/map.png"], to_hex(hash_of_bytes("a picture")));
  EXPECT_EQ(manifest["outputs_with_times"].size(), 1u);
  EXPECT_TRUE(manifest["outputs_with_times"].contains("summary.json"));
  EXPECT_EQ(manifest["inputs"][0]["sha256"], to_hex(hash_of_bytes("a log")));
  EXPECT_EQ(manifest["seed"], 7);
  EXPECT_EQ(manifest["versions"]["mapweave"], program_version());
}

}  // namespace
}  // namespace mapweave::runtime
