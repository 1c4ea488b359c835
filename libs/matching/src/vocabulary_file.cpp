#include "vocabulary_tree.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <zlib.h>

#include <algorithm>
#include <charconv>
#include <cmath>

namespace mapweave::matching {
namespace {

// More than any vocabulary; bounds what a hostile file takes.
constexpr std::uint64_t kMostFileBytes = std::uint64_t{1} << 28;
constexpr std::size_t kMostLineBytes = 512;           // of DBoW's text form: 32 numbers and a few more
constexpr int kMostBranching = 64, kMostLevels = 12;  // far beyond usual trees of 10 and 6
constexpr double kMostWeight = 1000.0;                // weights are logarithms of counts

// The numbers of one line.
class LineReader {
 public:
  LineReader(std::string_view line, std::string place) : rest_(line), place_(std::move(place)) {}

  template <class Number>
  Number next(const char* what) {
    skip_blanks();
    Number value{};
    const auto [end, error] = std::from_chars(rest_.data(), rest_.data() + rest_.size(), value);
    if (error != std::errc() || (end != rest_.data() + rest_.size() && *end != ' '))
      fail(std::string("expected ") + what);
    rest_.remove_prefix(static_cast<std::size_t>(end - rest_.data()));
    return value;
  }
  int next_within(const char* what, int low, int high) {
    const int value = next<int>(what);
    if (value < low || value > high)
      fail(std::string(what) + " is " + std::to_string(value) + ", not in " + std::to_string(low) + ".." +
           std::to_string(high));
    return value;
  }
  void expect_end() {
    skip_blanks();
    if (!rest_.empty()) fail("more on the line than there should be");
  }
  [[noreturn]] void fail(std::string what, ErrorCode code = ErrorCode::kCorrupt) const {
    throw Error(code, std::move(what), place_,
                "a vocabulary is the text layout of DBoW2, 'mapweave vocabulary train' makes one");
  }

 private:
  void skip_blanks() {
    while (!rest_.empty() && (rest_.front() == ' ' || rest_.front() == '\r')) rest_.remove_prefix(1);
  }
  std::string_view rest_;
  std::string place_;
};

// Takes the text in pieces, so that no file unpacks to more than its nodes.
class TreeReader {
 public:
  explicit TreeReader(std::string where) : where_(std::move(where)) {}

  void take(std::string_view text) {
    while (!text.empty()) {
      const std::size_t end = text.find('\n');
      line_.append(text.substr(0, end));
      if (line_.size() > kMostLineBytes) reader().fail("a line longer than any of a vocabulary");
      if (end == std::string_view::npos) return;
      take_line();
      text.remove_prefix(end + 1);
    }
  }

  BinaryVocabulary finish() {
    if (!line_.empty()) take_line();
    if (nodes_.empty()) reader().fail("no nodes");
    for (std::size_t i = 0; i < nodes_.size(); ++i)
      if (!nodes_[i].leaf && children_[i + 1] == 0)
        throw Error(ErrorCode::kCorrupt, "node " + std::to_string(i + 1) + " is neither a leaf nor a parent", where_,
                    "get the file again");
    return plant(branching_, levels_, nodes_);
  }

 private:
  LineReader reader() const { return {line_, where_ + ":" + std::to_string(lines_ + 1)}; }

  void take_line() {
    LineReader line = reader();
    if (lines_ == 0)
      take_head(line);
    else
      take_node(line);
    line.expect_end();
    ++lines_;
    line_.clear();
  }

  void take_head(LineReader& line) {
    branching_ = line.next_within("the number of branches", 2, kMostBranching);
    levels_ = line.next_within("the number of levels", 1, kMostLevels);
    if (line.next<int>("the kind of score") != 0) line.fail("only the L1 score (0) is known", ErrorCode::kUnsupported);
    if (line.next<int>("the kind of weights") != 0)
      line.fail("only weights by tf-idf (0) are known", ErrorCode::kUnsupported);
    children_.assign(1, 0);
    depth_.assign(1, 0);
  }

  void take_node(LineReader& line) {
    if (nodes_.size() >= kMostVocabularyNodes)
      line.fail("more than " + std::to_string(kMostVocabularyNodes) + " nodes", ErrorCode::kUnsupported);
    PlainNode node;
    node.parent = line.next<std::uint32_t>("the parent's number");
    if (node.parent > nodes_.size())
      line.fail("the parent " + std::to_string(node.parent) + " does not come before its child");
    if (node.parent > 0 && nodes_[node.parent - 1].leaf)
      line.fail("the parent " + std::to_string(node.parent) + " is a leaf");
    if (++children_[node.parent] > branching_)
      line.fail("node " + std::to_string(node.parent) + " has too many children");
    const int depth = depth_[node.parent] + 1;
    if (depth > levels_) line.fail("deeper than " + std::to_string(levels_) + " levels");
    node.leaf = line.next_within("leaf", 0, 1) == 1;
    std::uint8_t bytes[32];
    for (std::uint8_t& byte : bytes)
      byte = static_cast<std::uint8_t>(line.next_within("a byte of the descriptor", 0, 255));
    node.descriptor = descriptor_of_bytes(bytes);
    node.weight = line.next<double>("the weight");
    if (!(node.weight >= 0.0 && node.weight <= kMostWeight)) line.fail("a weight out of 0..1000");
    nodes_.push_back(node);
    children_.push_back(0);
    depth_.push_back(depth);
  }

  std::string where_, line_;
  std::size_t lines_ = 0;
  int branching_ = 0, levels_ = 0;
  std::vector<PlainNode> nodes_;
  std::vector<int> children_, depth_;  // of the root, then of nodes
};

struct Inflater {
  z_stream stream{};
  explicit Inflater(std::string_view packed) {
    constexpr int kGzip = 16 + MAX_WBITS;
    stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(packed.data()));
    stream.avail_in = static_cast<uInt>(packed.size());
    if (inflateInit2(&stream, kGzip) != Z_OK) throw Error(ErrorCode::kInternal, "zlib cannot start");
  }
  ~Inflater() { inflateEnd(&stream); }
  Inflater(const Inflater&) = delete;
  Inflater& operator=(const Inflater&) = delete;
};

void unpack(std::string_view packed, const std::string& where, TreeReader& reader) {
  Inflater inflater(packed);
  std::string piece(1 << 16, '\0');
  for (int state = Z_OK; state != Z_STREAM_END;) {
    inflater.stream.next_out = reinterpret_cast<Bytef*>(piece.data());
    inflater.stream.avail_out = static_cast<uInt>(piece.size());
    state = inflate(&inflater.stream, Z_NO_FLUSH);
    const std::size_t count = piece.size() - inflater.stream.avail_out;
    if ((state != Z_OK && state != Z_STREAM_END) || (state == Z_OK && count == 0))
      throw Error(ErrorCode::kCorrupt, "the gz data is damaged or cut short", where, "get the file again");
    reader.take(std::string_view(piece).substr(0, count));
  }
  if (inflater.stream.avail_in > 0)
    throw Error(ErrorCode::kCorrupt, "bytes follow the end of the gz data", where, "get the file again");
}

std::string packed(std::string_view text) {
  z_stream stream{};
  constexpr int kGzip = 16 + MAX_WBITS, kMemory = 9;
  if (deflateInit2(&stream, Z_BEST_COMPRESSION, Z_DEFLATED, kGzip, kMemory, Z_DEFAULT_STRATEGY) != Z_OK)
    throw Error(ErrorCode::kInternal, "zlib cannot start");
  std::string bytes(deflateBound(&stream, text.size()), '\0');
  stream.next_in = reinterpret_cast<Bytef*>(const_cast<char*>(text.data()));
  stream.avail_in = static_cast<uInt>(text.size());
  stream.next_out = reinterpret_cast<Bytef*>(bytes.data());
  stream.avail_out = static_cast<uInt>(bytes.size());
  const int state = deflate(&stream, Z_FINISH);
  bytes.resize(stream.total_out);
  deflateEnd(&stream);
  if (state != Z_STREAM_END) throw Error(ErrorCode::kInternal, "zlib cannot pack a vocabulary");
  return bytes;
}

}  // namespace

BinaryVocabulary parse_vocabulary(std::string_view bytes, const std::string& where) {
  TreeReader reader(where);
  if (bytes.substr(0, 2) == "\x1f\x8b")
    unpack(bytes, where, reader);
  else
    reader.take(bytes);
  return reader.finish();
}

BinaryVocabulary load_vocabulary(const std::filesystem::path& path) {
  return parse_vocabulary(read_file(path, kMostFileBytes), path.string());
}

void save_vocabulary(const BinaryVocabulary& vocabulary, const std::filesystem::path& path) {
  const BinaryVocabulary::Tree& tree = vocabulary.tree();
  std::string text = std::to_string(tree.branching) + " " + std::to_string(tree.levels) + " 0 0\n";
  for (std::size_t i = 0; i < tree.nodes.size(); ++i) {
    const VocabularyNode& node = tree.nodes[i];
    const bool leaf = node.children == 0;
    text += std::to_string(node.parent) + (leaf ? " 1" : " 0");
    for (std::size_t byte = 0; byte < 32; ++byte) text += " " + std::to_string(byte_of(tree.descriptors[i], byte));
    char weight[32];
    const auto end = std::to_chars(weight, weight + sizeof weight, leaf ? tree.weight_of_word[node.word] : 0.0).ptr;
    text.append(" ").append(weight, end).append("\n");
  }
  write_file(path, packed(text));
}

}  // namespace mapweave::matching
