#include "db3_reader.h"

#include "mcap_records.h"
#include "message_leaves.h"
#include "message_reader.h"
#include "zstd_file.h"

#include <mapweave/core/error.h>
#include <mapweave/core/log.h>
#include <mapweave/core/sqlite.h>
#include <mapweave/core/sqlite_file.h>

#include <algorithm>
#include <map>
#include <optional>
#include <vector>

namespace mapweave::rawlog::ros {
namespace {

namespace fs = std::filesystem;

constexpr const char* kKind = "rosbag2 recording";
constexpr const char* kCopyAgain = "copy the recording again, or map what precedes this with --keep-going";

// What a recorder that was killed left beside the file.
bool has_log(const fs::path& path) {
  for (const char* suffix : {"-wal", "-journal"}) {
    std::error_code ignored;
    const auto bytes = fs::file_size(path.string() + suffix, ignored);
    if (!ignored && bytes > 0) return true;
  }
  return false;
}

const fs::path& looked_at(const fs::path& path, const fs::path& shown) {
  try {
    expect_sqlite_file(path, kKind, ".db3", false);
  } catch (const Error& error) {
    throw placed(error, shown.string());
  }
  return path;
}

// A log beside it may hold the pages that it lacks.
bool is_cut(const fs::path& path) { return !has_log(path) && sqlite_file_bytes(path).is_cut(); }

Database::Use use_of(const fs::path& path) {
  if (has_log(path)) return Database::Use::read_with_log;
  return is_cut(path) ? Database::Use::read_cut : Database::Use::read;
}

class Db3Reader final : public BagReader {
 public:
  Db3Reader(const fs::path& path, const fs::path& shown, std::uint64_t most_bytes)
      : path_(path),
        database_(looked_at(path, shown), use_of(path), shown, kKind),
        most_bytes_(most_bytes),
        size_(sqlite_file_bytes(path)),
        is_cut_(is_cut(path)) {
    try {
      look_into();
    } catch (const Error& error) {
      if (is_cut_) throw cut_short(shown.string());
      throw;
    }
  }

  const std::vector<BagTopic>& topics() const override { return topics_; }

  void select(const std::vector<std::size_t>& topics) override {
    selected_.assign(topics_.size(), false);
    for (const std::size_t topic : topics) selected_.at(topic) = true;
  }

  bool next(BagMessage& message) override {
    if (ended_) return false;
    if (leaves_) return next_of_leaves(message);
    try {
      if (!rows_) rows_.emplace(database_, query().c_str());
      while (rows_->step())
        if (take(message)) return true;
    } catch (const Error& error) {
      if (!is_cut_) {
        ended_ = true;
        throw Error(error.code(), error.problem(), place(), error.remedy());
      }
      rows_.reset();
      leaves_.emplace(path_, most_bytes_);
      return next_of_leaves(message);
    }
    ended_ = true;
    if (is_cut_)
      log(LogLevel::warning,
          database_.shown().string() + ": the recording is cut short, behind its last message: none is lost");
    return false;
  }

  std::string place_name(std::uint64_t place) const override {
    return database_.shown().string() + " at message " + std::to_string(place);
  }
  std::uint64_t bytes_read() const override {
    if (ended_) return size_.there;
    if (last_row_ <= 0) return std::min(size_.there, data_bytes_);
    const double done =
        static_cast<double>(std::clamp<std::int64_t>(row_, 0, last_row_)) / static_cast<double>(last_row_);
    return static_cast<std::uint64_t>(done * static_cast<double>(size_.there));
  }
  std::uint64_t bytes_total() const override { return size_.there; }

 private:
  void look_into() {
    if (database_.number(
            "SELECT count(*) FROM sqlite_schema WHERE type = 'table' AND name IN ('topics', 'messages')") != 2)
      throw Error(ErrorCode::kBadInput,
                  "is an SQLite file, but no recording of rosbag2: it lacks the tables topics and messages",
                  database_.shown().string(), "check the path");
    read_topics();
    // The last row and the index would lead behind the cut.
    if (is_cut_) return;
    // Rows were written in the order of receipt, nearly. Sorting without an index would hold all messages.
    is_sorted_ = database_.number(
                     "SELECT count(*) FROM sqlite_schema WHERE type = 'index' AND tbl_name = 'messages' "
                     "AND sql LIKE '%timestamp%'") > 0;
    last_row_ = database_.number("SELECT coalesce(max(id), 0) FROM messages");
  }

  std::string place() const {
    return row_ == 0 ? database_.shown().string() : place_name(static_cast<std::uint64_t>(row_));
  }

  // Where the pages that lead to messages are missing. It ends with the cut.
  bool next_of_leaves(BagMessage& message) {
    try {
      for (MessageRow row; leaves_->next(row_, row);) {
        row_ = row.id;
        if (take(row.topic, row.received_ns, row.data, message)) return true;
      }
    } catch (const Error&) {  // it is damaged as well: what precedes that has been read
    }
    ended_ = true;
    throw cut_short(row_ == 0 ? place() : "after " + place());
  }

  Error cut_short(const std::string& where) const {
    return Error(ErrorCode::kCorrupt,
                 "the recording is cut short: it needs " + std::to_string(size_.needed) + " bytes, " +
                     std::to_string(size_.there) + " are there",
                 where, kCopyAgain);
  }

  void read_topics() {
    std::string left_out;
    Statement rows(database_, "SELECT id, name, type, serialization_format FROM topics ORDER BY id");
    while (rows.step()) {
      BagTopic topic;
      topic.name = rows.text(1);
      topic.type = type_without_msg(rows.text(2));
      topic.encoding = MessageEncoding::cdr;
      const std::string format = rows.text(3);
      if (format != "cdr") {
        left_out += (left_out.empty() ? "" : ", ") + topic.name + " (" + format + ")";
        topic_of_.emplace(rows.integer(0), std::nullopt);
        continue;
      }
      topic_of_.emplace(rows.integer(0), topics_.size());
      topics_.push_back(std::move(topic));
    }
    if (left_out.empty()) return;
    if (topics_.empty())
      throw Error(ErrorCode::kUnsupported, "holds no messages in CDR, but " + left_out, database_.shown().string(),
                  "convert it: ros2 bag convert");
    log(LogLevel::warning,
        database_.shown().string() + ": topics whose messages are not CDR were left out: " + left_out);
  }

  // Columns are asked for in the order of the table: those of rows that are not selected are not read.
  std::string query() const {
    std::string ids;
    for (const auto& [id, topic] : topic_of_)
      if (topic && !is_selected(*topic)) ids += (ids.empty() ? "" : ", ") + std::to_string(id);
    return "SELECT id, topic_id, timestamp, data FROM messages" +
           (ids.empty() ? "" : " WHERE topic_id NOT IN (" + ids + ")") +
           (is_sorted_ ? " ORDER BY timestamp, id" : " ORDER BY id");
  }

  bool is_selected(std::size_t topic) const { return selected_.empty() || selected_[topic]; }

  bool take(BagMessage& message) {
    row_ = rows_->integer(0);
    return take(rows_->integer(1), rows_->integer(2), rows_->bytes(3), message);
  }

  bool take(std::int64_t topic_id, std::int64_t received_ns, std::string_view data, BagMessage& message) {
    const auto topic = topic_of_.find(topic_id);
    if (topic == topic_of_.end())
      throw Error(ErrorCode::kCorrupt,
                  "the message is of topic " + std::to_string(topic_id) + ", which the table of topics does not hold",
                  {}, kCopyAgain);
    if (!topic->second || !is_selected(*topic->second)) return false;
    message.topic = *topic->second;
    message.received_ns = received_ns;
    message.place = static_cast<std::uint64_t>(row_);
    data_bytes_ += data.size();
    unpack_message(data, most_bytes_, message.data);
    return true;
  }

  fs::path path_;
  Database database_;
  std::uint64_t most_bytes_, data_bytes_ = 0;  // data_bytes_: of the messages so far, as they are in the file
  SqliteFileBytes size_;
  bool is_cut_;
  std::map<std::int64_t, std::optional<std::size_t>> topic_of_;  // by id; nullopt: left out
  std::vector<BagTopic> topics_;
  std::vector<bool> selected_;  // empty: all
  bool is_sorted_ = false, ended_ = false;
  std::int64_t last_row_ = 0, row_ = 0;
  std::optional<Statement> rows_;        // ends before database_
  std::optional<MessageLeaves> leaves_;  // once the rows lead behind the cut
};

}  // namespace

std::unique_ptr<BagReader> open_db3_as(const fs::path& path, const fs::path& shown, std::uint64_t most_bytes) {
  return std::make_unique<Db3Reader>(path, shown, most_bytes);
}

}  // namespace mapweave::rawlog::ros
