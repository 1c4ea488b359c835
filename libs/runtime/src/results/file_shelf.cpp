#include "file_shelf.h"

#include <mapweave/core/error.h>

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>

namespace mapweave::runtime {
namespace {

Error cannot_write(const std::filesystem::path& folder, int problem) {
  std::string what = "cannot write what a camera map server keeps: " + std::string(std::strerror(problem));
  std::error_code unknown;
  const auto space = std::filesystem::space(folder, unknown);
  if (problem == ENOSPC && !unknown) what += " (" + std::to_string(space.available) + " bytes free)";
  return {ErrorCode::kCannotWrite, what, folder.string(), "free some space, or name another folder in TMPDIR"};
}

}  // namespace

std::filesystem::path folder_of_temporary_files() {
  std::error_code none;
  const auto folder = std::filesystem::temp_directory_path(none);
  return none ? std::filesystem::path(".") : folder;
}

FileShelf::~FileShelf() {
  if (file_ >= 0) ::close(file_);
}

void FileShelf::open() {
  std::string name = (folder_ / "mapweave-kept-XXXXXX").string();
  file_ = ::mkostemp(name.data(), O_CLOEXEC);
  if (file_ < 0) throw cannot_write(folder_, errno);
  ::unlink(name.c_str());
}

std::uint64_t FileShelf::put(std::string_view bytes) {
  const std::lock_guard lock(mutex_);
  if (file_ < 0) open();
  for (std::size_t done = 0; done < bytes.size();) {
    const ssize_t count = ::pwrite(file_, bytes.data() + done, bytes.size() - done, static_cast<off_t>(end_ + done));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) throw cannot_write(folder_, count < 0 ? errno : ENOSPC);
    done += static_cast<std::size_t>(count);
  }
  places_.push_back({end_, bytes.size()});
  end_ += bytes.size();
  return places_.size() - 1;
}

std::string FileShelf::get(std::uint64_t number) const {
  const std::lock_guard lock(mutex_);
  MAPWEAVE_EXPECT(number < places_.size(), "it was put there");
  const Place& place = places_[number];
  std::string bytes(place.size, '\0');
  for (std::size_t done = 0; done < bytes.size();) {
    const ssize_t count =
        ::pread(file_, bytes.data() + done, bytes.size() - done, static_cast<off_t>(place.begin + done));
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0)
      throw Error(ErrorCode::kCorrupt, "what a camera map server keeps cannot be read again", folder_.string(),
                  "look at the disk");
    done += static_cast<std::size_t>(count);
  }
  return bytes;
}

}  // namespace mapweave::runtime
