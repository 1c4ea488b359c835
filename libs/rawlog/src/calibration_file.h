#pragma once
// YAML files of calibrations: camera.yaml beside TUM's lists, EuRoC's sensor.yaml.

#include <mapweave/core/error.h>
#include <mrpt/img/TCamera.h>
#include <mrpt/poses/CPose3D.h>

#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace mapweave::rawlog {

class CalibrationFile {
 public:
  // `keys`: what is expected in it, for messages. Throws Error: kMissing, kBadInput for what is no YAML, as do the
  // others for a key that is missing or of another kind.
  CalibrationFile(std::filesystem::path path, std::string keys);
  ~CalibrationFile();
  CalibrationFile(const CalibrationFile&) = delete;
  CalibrationFile& operator=(const CalibrationFile&) = delete;

  bool has(const std::string& key) const;
  std::vector<std::string> keys() const;        // of the top level, in the file's order
  double number(const std::string& key) const;  // finite, as all numbers here
  std::vector<double> numbers(const std::string& key, std::size_t least, std::size_t most) const;
  std::vector<double> numbers(const std::string& key, const std::string& key_within, std::size_t count) const;
  std::string text(const std::string& key) const;
  bool flag(const std::string& key) const;
  Error wrong(const std::string& key, const std::string& what) const;
  const std::filesystem::path& path() const { return path_; }

 private:
  struct Tree;
  std::filesystem::path path_;
  std::string keys_;
  std::unique_ptr<Tree> tree_;
};

// A pinhole camera. `distortion`: k1 k2 p1 p2 [k3]; all zero: MRPT's "none". Throws Error kBadInput, naming `where`,
// for a camera that cannot be.
mrpt::img::TCamera make_camera(double width, double height, const std::vector<double>& fx_fy_cx_cy,
                               const std::vector<double>& distortion, const std::string& where);
// 4 x 4 row by row. Throws Error kBadInput for what is no rotation and translation.
mrpt::poses::CPose3D make_pose(const std::vector<double>& rows, const std::string& where);

}  // namespace mapweave::rawlog
