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

TEST(Manifest, knows_a_folder_of_pictures_by_its_names_and_bytes) {
  test::TemporaryFolder folder;
  for (const char* walk : {"walk", "same", "renamed", "changed"}) {
    std::filesystem::create_directories(folder / walk / "rgb");
    write_file(folder / walk / "rgb.txt", "a list");
  }
  write_file(folder / "walk" / "rgb" / "1.png", "a picture");
  write_file(folder / "same" / "rgb" / "1.png", "a picture");
  write_file(folder / "renamed" / "rgb" / "2.png", "a picture");
  write_file(folder / "changed" / "rgb" / "1.png", "another");
  std::filesystem::create_directory_symlink(folder / "same", folder / "same" / "rgb" / "circle");
  const Hash walk = hash_of_input(folder / "walk");
  EXPECT_NE(walk, hash_of_input(folder / "renamed"));
  EXPECT_NE(walk, hash_of_input(folder / "changed"));
  EXPECT_NE(walk, hash_of_input(folder / "same"));  // its files come twice; what matters is that it ends
  std::filesystem::remove(folder / "same" / "rgb" / "circle");
  EXPECT_EQ(walk, hash_of_input(folder / "same"));
  EXPECT_EQ(hash_of_input(folder / "walk" / "rgb.txt"), hash_of_bytes("a list"));
}

}  // namespace
}  // namespace mapweave::runtime
