// Recordings of ROS 2: MCAP, SQLite (db3), and the description of a folder of them.

#include "logs.h"

#include <ros/mcap_records.h>
#include <ros/rosbag2_metadata.h>
#include <support/data.h>

#include <cstring>

namespace mapweave::fuzz {
namespace {

namespace fs = std::filesystem;

fs::path sound(const std::string& name) { return test::own_data("ros2/" + name); }

std::string sound_bytes(const std::string& name) { return file_bytes(sound(name)); }

// A folder whose recordings are sound and whose description is the input.
void read_described(std::string_view bytes) {
  if (!fs::exists(scratch_folder() / "split"))
    fs::copy(sound("split"), scratch_folder() / "split", fs::copy_options::recursive);
  scratch_file("split/metadata.yaml", bytes);
  read_log(scratch_folder() / "split");
}

const std::vector<Kind>& kinds() {
  static const std::vector<Kind> all = {
      {[](std::string_view bytes) { read_log(scratch_file("input.mcap", bytes)); },
       {sound_bytes("none.mcap"), sound_bytes("lz4.mcap"), sound_bytes("zstd.mcap"), sound_bytes("unchunked.mcap"),
        sound_bytes("no_summary.mcap"), sound_bytes("ros1.mcap"),
        sound_bytes("message_zstd_mcap/message_zstd_mcap.mcap")}},
      {[](std::string_view bytes) { read_log(scratch_file("input.db3", bytes)); },
       {sound_bytes("plain/plain.db3"), sound_bytes("message_zstd/message_zstd.db3")}},
      {read_described, {sound_bytes("split/metadata.yaml")}}};
  return all;
}

}  // namespace

std::vector<std::string> seeds() { return seeds_of(kinds()); }
void decode(std::string_view bytes) { decode_one_of(kinds(), bytes); }

}  // namespace mapweave::fuzz
