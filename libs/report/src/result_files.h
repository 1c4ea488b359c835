#pragma once
// The files of a folder of results: read if they are there, named if they are not, or cannot be read.

#include "encoding.h"

#include <filesystem>
#include <functional>
#include <optional>
#include <string>
#include <vector>

namespace mapweave::report {

class ResultFiles {
 public:
  explicit ResultFiles(std::filesystem::path folder) : folder_(std::move(folder)) {}

  bool has(const std::string& name) const;
  std::filesystem::path path(const std::string& name) const { return folder_ / name; }
  // Notes a missing file; null then, or if it is damaged.
  Json json(const std::string& name);
  // Runs what reads `name`; a failure becomes a problem of the page. False then.
  bool attempt(const std::string& name, const std::function<void()>& read);
  // Names of the folders, or files, in a folder of the results; sorted, empty if it is not there.
  std::vector<std::string> folders_in(const std::string& name) const { return names_in(name, true); }
  std::vector<std::string> files_in(const std::string& name) const { return names_in(name, false); }

  void miss(const std::string& name) { missing_.push_back(name); }
  const std::vector<std::string>& missing() const { return missing_; }
  const std::vector<std::string>& problems() const { return problems_; }

 private:
  std::vector<std::string> names_in(const std::string& name, bool folders) const;
  std::filesystem::path folder_;
  std::vector<std::string> missing_, problems_;
};

}  // namespace mapweave::report
