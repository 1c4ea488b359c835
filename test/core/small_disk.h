#pragma once
#include <gtest/gtest.h>
#include <sys/mount.h>

#include <support/temporary_folder.h>
#include <cerrno>
#include <cstring>

namespace mapweave::test {

// A disk of 64 kB, where the machine permits to mount one.
class SmallDisk {
 public:
  SmallDisk()
      : is_mounted_(::mount("tmpfs", folder_.path().c_str(), "tmpfs", 0, "size=64k") == 0),
        problem_(is_mounted_ ? "" : std::strerror(errno)) {}
  ~SmallDisk() {
    if (is_mounted_) ::umount(folder_.path().c_str());
  }
  bool is_mounted() const { return is_mounted_; }
  const std::string& problem() const { return problem_; }
  const std::filesystem::path& path() const { return folder_.path(); }
  std::filesystem::path operator/(const std::string& name) const { return folder_ / name; }

 private:
  TemporaryFolder folder_;
  bool is_mounted_;
  std::string problem_;
};

}  // namespace mapweave::test
