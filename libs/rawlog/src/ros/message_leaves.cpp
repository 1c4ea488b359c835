#include "message_leaves.h"

#include <algorithm>
#include <optional>

namespace mapweave::rawlog::ros {
namespace {

constexpr char kTableLeaf = 0x0d;
constexpr std::size_t kLeafHeader = 8;
constexpr std::uint64_t kNull = 0, kFirstBlob = 12;  // types of values; integers are between them

std::uint64_t big_endian(std::string_view bytes) {
  std::uint64_t value = 0;
  for (const char byte : bytes) value = value << 8U | static_cast<unsigned char>(byte);
  return value;
}

// Takes what it reads off the front. Nullopt: there are too few bytes.
std::optional<std::uint64_t> take_varint(std::string_view& bytes) {
  std::uint64_t value = 0;
  for (std::size_t i = 0; i < 9 && i < bytes.size(); ++i) {
    const auto byte = static_cast<unsigned char>(bytes[i]);
    value = i == 8 ? value << 8U | byte : value << 7U | (byte & 0x7fU);
    if (i < 8 && (byte & 0x80U) != 0) continue;
    bytes.remove_prefix(i + 1);
    return value;
  }
  return std::nullopt;
}

std::optional<std::int64_t> take_integer(std::uint64_t type, std::string_view& bytes) {
  constexpr std::size_t kBytes[] = {0, 1, 2, 3, 4, 6, 8, 0, 0, 0};
  if (type == 8 || type == 9) return static_cast<std::int64_t>(type) - 8;
  if (type < 1 || type > 6 || bytes.size() < kBytes[type]) return std::nullopt;
  const std::size_t count = kBytes[type];
  const unsigned shift = 8U * static_cast<unsigned>(sizeof(std::int64_t) - count);
  const std::uint64_t value = big_endian(bytes.substr(0, count));
  bytes.remove_prefix(count);
  return static_cast<std::int64_t>(value << shift) >> shift;  // with its sign
}

// Of a row (id: null, an integer, an integer, bytes). False: it is one of another table, or damaged.
bool decode(std::string_view content, MessageRow& row) {
  std::string_view header = content;
  const auto header_bytes = take_varint(header);
  if (!header_bytes || *header_bytes > content.size()) return false;
  std::string_view values = content.substr(*header_bytes);
  header = content.substr(content.size() - header.size(), *header_bytes - (content.size() - header.size()));
  std::vector<std::uint64_t> types;
  while (!header.empty() && types.size() <= 4) {
    const auto type = take_varint(header);
    if (!type) return false;
    types.push_back(*type);
  }
  if (types.size() != 4 || types[0] != kNull || types[3] < kFirstBlob || types[3] % 2 != 0) return false;
  const auto topic = take_integer(types[1], values);
  const auto received_ns = take_integer(types[2], values);
  if (!topic || !received_ns || values.size() != (types[3] - kFirstBlob) / 2) return false;
  row.topic = *topic;
  row.received_ns = *received_ns;
  row.data = values;
  return true;
}

}  // namespace

MessageLeaves::MessageLeaves(const std::filesystem::path& path, std::uint64_t most_bytes)
    : file_(path), most_bytes_(most_bytes) {
  std::string header(100, '\0');
  if (!file_.read_at(0, header.data(), header.size())) return;
  page_bytes_ = static_cast<std::size_t>(big_endian(std::string_view(header).substr(16, 2)));
  if (page_bytes_ == 1) page_bytes_ = 65536;
  const auto reserved = static_cast<std::size_t>(static_cast<unsigned char>(header[20]));
  if (page_bytes_ < 512 || page_bytes_ < reserved + 480) return;
  usable_ = page_bytes_ - reserved;
  std::string page;
  for (std::uint64_t number = 1; (number + 1) * page_bytes_ <= file_.bytes(); ++number) {
    char type = 0;
    Cell first;
    if (!file_.read_at(number * page_bytes_, &type, 1) || type != kTableLeaf || !read_page(number, page) ||
        !cell_at(page, 0, first))
      continue;
    MessageRow row;
    if (read_row(page, first, row)) leaves_.push_back({first.id, number});
  }
  std::stable_sort(leaves_.begin(), leaves_.end(),
                   [](const Leaf& l, const Leaf& r) { return l.first_id < r.first_id; });
}

bool MessageLeaves::next(std::int64_t after, MessageRow& row) {
  for (; leaf_ < leaves_.size(); ++leaf_, cell_ = 0) {
    // Of leaves that lie before a later one which is not above `after` nothing is left.
    if (cell_ == 0 && leaf_ + 1 < leaves_.size() && leaves_[leaf_ + 1].first_id <= after) continue;
    if (cell_ == 0 && !read_page(leaves_[leaf_].page, page_)) return false;
    for (Cell cell; cell_at(page_, cell_, cell); ++cell_) {
      if (cell.id <= after) continue;
      if (!read_row(page_, cell, row)) return false;
      ++cell_;
      return true;
    }
  }
  return false;
}

bool MessageLeaves::read_page(std::uint64_t page, std::string& bytes) const {
  bytes.resize(page_bytes_);
  return file_.read_at(page * page_bytes_, bytes.data(), page_bytes_);
}

bool MessageLeaves::cell_at(const std::string& page, std::size_t number, Cell& cell) const {
  const std::string_view all(page);
  if (number >= big_endian(all.substr(3, 2)) || kLeafHeader + 2 * number + 2 > usable_) return false;
  const auto begin = static_cast<std::size_t>(big_endian(all.substr(kLeafHeader + 2 * number, 2)));
  if (begin < kLeafHeader || begin >= usable_) return false;
  std::string_view rest = all.substr(begin, usable_ - begin);
  const auto bytes = take_varint(rest);
  const auto id = bytes ? take_varint(rest) : std::nullopt;
  if (!id) return false;
  cell = {*bytes, static_cast<std::int64_t>(*id), usable_ - rest.size()};
  return true;
}

bool MessageLeaves::read_row(const std::string& page, const Cell& cell, MessageRow& row) const {
  std::string content;
  if (!read_content(page, cell, content) || !decode(content, row)) return false;
  row.id = cell.id;
  return true;
}

// What does not fit into the page goes on in a chain of others.
bool MessageLeaves::read_content(const std::string& page, const Cell& cell, std::string& content) const {
  if (cell.bytes > std::min(most_bytes_, file_.bytes())) return false;
  const auto bytes = static_cast<std::size_t>(cell.bytes);
  std::size_t here = bytes;
  if (bytes > usable_ - 35) {
    const std::size_t least = (usable_ - 12) * 32 / 255 - 23, fitting = least + (bytes - least) % (usable_ - 4);
    here = fitting <= usable_ - 35 ? fitting : least;
  }
  const bool goes_on = here < bytes;
  if (cell.begin + here + (goes_on ? 4 : 0) > usable_) return false;
  content.assign(page, cell.begin, here);
  if (!goes_on) return true;
  content.reserve(bytes);
  std::uint64_t next = big_endian(std::string_view(page).substr(cell.begin + here, 4));
  std::string other;
  while (content.size() < bytes) {
    if (next == 0 || !read_page(next - 1, other)) return false;
    next = big_endian(std::string_view(other).substr(0, 4));
    content.append(other, 4, std::min(usable_ - 4, bytes - content.size()));
  }
  return true;
}

}  // namespace mapweave::rawlog::ros
