#pragma once
// What a camera map server does not hold in memory, in a file without a name: it vanishes with the process.

#include <mapweave/tiers/shelf.h>

#include <filesystem>
#include <mutex>
#include <vector>

namespace mapweave::runtime {

class FileShelf : public tiers::Shelf {
 public:
  // The file is made when something is to be put there.
  explicit FileShelf(std::filesystem::path folder) : folder_(std::move(folder)) {}
  ~FileShelf() override;
  FileShelf(const FileShelf&) = delete;
  FileShelf& operator=(const FileShelf&) = delete;
  std::uint64_t put(std::string_view bytes) override;
  std::string get(std::uint64_t number) const override;

 private:
  struct Place {
    std::uint64_t begin, size;
  };
  void open();
  const std::filesystem::path folder_;
  mutable std::mutex mutex_;
  int file_ = -1;
  std::uint64_t end_ = 0;
  std::vector<Place> places_;
};

// Where what need not outlive the process goes.
std::filesystem::path folder_of_temporary_files();

}  // namespace mapweave::runtime
