#include <fcntl.h>
#include <mapweave/core/error.h>
#include <mapweave/rawlog/rawlog_writer.h>
#include <mrpt/serialization/CArchive.h>
#include <unistd.h>
#include <zlib.h>

#include <atomic>
#include <cerrno>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

namespace mapweave::rawlog {
namespace {

constexpr std::size_t kBlockBytes = 1 << 18;
constexpr int kGz =
    15 + 16;  // zlib's window bits, plus "write a gz header" (without a name or a time, so that bytes repeat)

class MemoryArchive final : public mrpt::serialization::CArchive {
 public:
  std::string bytes;

 protected:
  std::size_t write(const void* from, std::size_t count) override {
    bytes.append(static_cast<const char*>(from), count);
    return count;
  }
  std::size_t read(void*, std::size_t) override { return 0; }
};

std::filesystem::path beside(const std::filesystem::path& path) {
  static std::atomic<unsigned> count{0};
  auto partial = path;
  partial += ".partial-" + std::to_string(::getpid()) + "-" + std::to_string(count++);
  return partial;
}

}  // namespace

struct RawlogWriter::State {
  explicit State(std::filesystem::path path) : goal(std::move(path)), partial(beside(goal)), packed(kBlockBytes) {
    file = ::open(partial.c_str(), O_WRONLY | O_CREAT | O_EXCL | O_CLOEXEC, 0666);
    if (file < 0) throw cannot_write();
    if (::deflateInit2(&deflater, Z_DEFAULT_COMPRESSION, Z_DEFLATED, kGz, 8, Z_DEFAULT_STRATEGY) != Z_OK) {
      give_up();
      throw Error(ErrorCode::kInternal, "zlib cannot start", goal.string());
    }
    deflating = true;
  }
  ~State() { give_up(); }

  void give_up() {
    if (deflating) ::deflateEnd(&deflater);
    if (file >= 0) {
      ::close(file);
      ::unlink(partial.c_str());
    }
    deflating = false;
    file = -1;
  }

  Error cannot_write() const {
    const int number = errno;
    std::string problem = "cannot be written: " + std::generic_category().message(number);
    std::string remedy = "check that the folder exists and that you may write there";
    if (number == ENOSPC || number == EDQUOT) {
      std::error_code ignored;
      const auto space = std::filesystem::space(goal.has_parent_path() ? goal.parent_path() : ".", ignored);
      if (!ignored) problem += " (" + std::to_string(space.available) + " bytes free)";
      remedy = "free some space or choose another folder";
    }
    return Error(ErrorCode::kCannotWrite, problem, goal.string(), remedy);
  }

  void write_out(const char* from, std::size_t count) {
    while (count > 0) {
      const ssize_t written = ::write(file, from, count);
      if (written < 0 && errno == EINTR) continue;
      if (written < 0) {
        const Error error = cannot_write();
        give_up();
        throw error;
      }
      from += written;
      count -= static_cast<std::size_t>(written);
    }
  }

  void deflate_all(int flush) {
    deflater.next_in = reinterpret_cast<Bytef*>(archive.bytes.data());
    deflater.avail_in = static_cast<uInt>(archive.bytes.size());
    do {
      deflater.next_out = reinterpret_cast<Bytef*>(packed.data());
      deflater.avail_out = static_cast<uInt>(packed.size());
      ::deflate(&deflater, flush);
      write_out(packed.data(), packed.size() - deflater.avail_out);
    } while (deflater.avail_out == 0);
    archive.bytes.clear();
  }

  std::filesystem::path goal, partial;
  int file = -1;
  bool deflating = false;
  z_stream deflater{};
  std::vector<char> packed;
  MemoryArchive archive;
  std::uint64_t observations = 0;
};

RawlogWriter::RawlogWriter(std::filesystem::path path) : state_(std::make_unique<State>(std::move(path))) {}
RawlogWriter::~RawlogWriter() = default;

void RawlogWriter::add(const mrpt::obs::CObservation& observation) {
  MAPWEAVE_EXPECT(state_->file >= 0, "a writer that is open");
  try {
    state_->archive.WriteObject(observation);
  } catch (const std::exception& problem) {
    throw Error(ErrorCode::kInternal,
                "MRPT cannot write an observation of '" + observation.sensorLabel + "' (" +
                    std::string(problem.what()).substr(0, 200) + ")",
                state_->goal.string());
  }
  ++state_->observations;
  if (state_->archive.bytes.size() >= kBlockBytes) state_->deflate_all(Z_NO_FLUSH);
}

void RawlogWriter::close() {
  MAPWEAVE_EXPECT(state_->file >= 0, "a writer that is open");
  State& state = *state_;
  state.deflate_all(Z_FINISH);
  const auto check = [&](int answer) {
    if (answer == 0) return;
    const Error error = state.cannot_write();
    state.give_up();
    throw error;
  };
  check(::fsync(state.file) == 0 || errno == EINVAL ? 0 : -1);
  if (::close(std::exchange(state.file, -1)) != 0 || ::rename(state.partial.c_str(), state.goal.c_str()) != 0) {
    const Error error = state.cannot_write();
    ::unlink(state.partial.c_str());
    throw error;
  }
}

std::uint64_t RawlogWriter::count() const { return state_->observations; }

}  // namespace mapweave::rawlog
