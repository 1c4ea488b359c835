#pragma once
// Messages of a rosbag2 file (.db3) that is cut short, from the pages that hold them: those that lead to them may lie
// behind the cut. Source: SQLite's file format (sqlite.org/fileformat2.html), sections 1.6, 2.1.

#include "seekable_file.h"

#include <string_view>
#include <vector>

namespace mapweave::rawlog::ros {

// A row of the table `messages`.
struct MessageRow {
  std::int64_t id = 0, topic = 0, received_ns = 0;
  std::string data;
};

class MessageLeaves {
 public:
  // most_bytes: of a row; what claims more is damage. Throws Error as SeekableFile does. Looks for the pages, which
  // takes a small read for each page of the file.
  MessageLeaves(const std::filesystem::path& path, std::uint64_t most_bytes);

  // The next row by id, above `after`; false: the rest is behind the cut, or damaged.
  bool next(std::int64_t after, MessageRow& row);

 private:
  struct Leaf {
    std::int64_t first_id;
    std::uint64_t page;
  };
  struct Cell {
    std::uint64_t bytes;  // of the row, wherever they lie
    std::int64_t id;
    std::size_t begin;  // of what lies in the page
  };
  bool read_page(std::uint64_t page, std::string& bytes) const;
  bool cell_at(const std::string& page, std::size_t number, Cell& cell) const;
  bool read_row(const std::string& page, const Cell& cell, MessageRow& row) const;
  bool read_content(const std::string& page, const Cell& cell, std::string& content) const;

  SeekableFile file_;
  std::uint64_t most_bytes_;
  std::size_t page_bytes_ = 0, usable_ = 0;
  std::vector<Leaf> leaves_;  // by their first ids
  std::string page_;          // the leaf that is read
  std::size_t leaf_ = 0, cell_ = 0;
};

}  // namespace mapweave::rawlog::ros
