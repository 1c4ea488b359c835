// Bags of ROS 1, with what becomes of their messages.

#include "logs.h"

#include <rawlog/bags.h>

namespace mapweave::fuzz {
namespace {

std::vector<rawlog::BagEntry> drive() { return rawlog::small_drive(3); }

std::string with_compression(const std::string& compression) {
  rawlog::BagForm form;
  form.compression = compression;
  return rawlog::bag_bytes(drive(), form);
}

std::string not_closed() {
  rawlog::BagForm form;
  form.is_closed = false;
  return rawlog::bag_bytes(drive(), form);
}

}  // namespace

std::vector<std::string> seeds() {
  return {rawlog::bag_bytes(drive()), not_closed(), with_compression("bz2"), with_compression("lz4")};
}

void decode(std::string_view bytes) { read_log(scratch_file("input.bag", bytes)); }

}  // namespace mapweave::fuzz
