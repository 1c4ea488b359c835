#include "calibration_file.h"

#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mrpt/math/CMatrixFixed.h>
#include <yaml-cpp/yaml.h>

#include <Eigen/Core>
#include <Eigen/LU>
#include <cmath>

namespace mapweave::rawlog {
namespace {

constexpr std::uint64_t kMostBytes = 1 << 20;
constexpr double kMostPixels = 20'000.0;  // of a picture's side

}  // namespace

struct CalibrationFile::Tree {
  YAML::Node root;
};

CalibrationFile::CalibrationFile(std::filesystem::path path, std::string keys)
    : path_(std::move(path)), keys_(std::move(keys)), tree_(std::make_unique<Tree>()) {
  std::error_code ignored;
  if (!std::filesystem::is_regular_file(path_, ignored))
    throw Error(ErrorCode::kMissing, "there is no calibration", path_.string(), "write it, with the keys " + keys_);
  std::string text = read_file(path_, kMostBytes);
  if (text.compare(0, 6, "%YAML:") == 0) text.erase(0, text.find('\n'));  // OpenCV's habit, which is no YAML
  try {
    tree_->root = YAML::Load(text);
  } catch (const YAML::Exception& problem) {
    throw Error(ErrorCode::kBadInput, "is no YAML: " + problem.msg,
                path_.string() + ":" + std::to_string(problem.mark.line + 1), "correct the line");
  }
  if (!tree_->root.IsMap())
    throw Error(ErrorCode::kBadInput, "is no calibration; keys and values were expected", path_.string(),
                "write the keys " + keys_);
}

CalibrationFile::~CalibrationFile() = default;

bool CalibrationFile::has(const std::string& key) const { return tree_->root[key].IsDefined(); }

std::vector<std::string> CalibrationFile::keys() const {
  std::vector<std::string> keys;
  for (const auto& entry : tree_->root)
    if (entry.first.IsScalar()) keys.push_back(entry.first.Scalar());
  return keys;
}

Error CalibrationFile::wrong(const std::string& key, const std::string& what) const {
  const YAML::Node node = tree_->root[key];
  const std::string where = path_.string() + (node.IsDefined() ? ":" + std::to_string(node.Mark().line + 1) : "");
  return Error(ErrorCode::kBadInput, "'" + key + "' " + what, where, "the keys are " + keys_);
}

namespace {

std::optional<double> number_in(const YAML::Node& node) {
  double value = 0.0;
  if (!node.IsDefined() || !node.IsScalar() || !YAML::convert<double>::decode(node, value) || !std::isfinite(value))
    return std::nullopt;
  return value;
}

std::optional<std::vector<double>> numbers_in(const YAML::Node& node) {
  if (!node.IsDefined() || !node.IsSequence()) return std::nullopt;
  std::vector<double> values;
  for (const YAML::Node& item : node) {
    const auto value = number_in(item);
    if (!value) return std::nullopt;
    values.push_back(*value);
  }
  return values;
}

}  // namespace

double CalibrationFile::number(const std::string& key) const {
  if (!has(key)) throw wrong(key, "is missing; a number was expected");
  if (const auto value = number_in(tree_->root[key])) return *value;
  throw wrong(key, "is no number; a finite number was expected");
}

std::vector<double> CalibrationFile::numbers(const std::string& key, std::size_t least, std::size_t most) const {
  const std::string count =
      least == most ? std::to_string(least) : std::to_string(least) + " to " + std::to_string(most);
  if (!has(key)) throw wrong(key, "is missing; a list of " + count + " numbers was expected");
  const auto values = numbers_in(tree_->root[key]);
  if (!values || values->size() < least || values->size() > most)
    throw wrong(key, "does not fit; a list of " + count + " numbers was expected");
  return *values;
}

std::vector<double> CalibrationFile::numbers(const std::string& key, const std::string& key_within,
                                             std::size_t count) const {
  const std::string expected =
      "a list of " + std::to_string(count) + " numbers was expected in its '" + key_within + "'";
  if (!has(key)) throw wrong(key, "is missing; " + expected);
  const YAML::Node node = tree_->root[key];
  const auto values = node.IsMap() ? numbers_in(node[key_within]) : std::nullopt;
  if (!values || values->size() != count) throw wrong(key, "does not fit; " + expected);
  return *values;
}

std::string CalibrationFile::text(const std::string& key) const {
  if (!has(key) || !tree_->root[key].IsScalar()) throw wrong(key, "is missing; a word was expected");
  return tree_->root[key].Scalar();
}

bool CalibrationFile::flag(const std::string& key) const {
  bool value = false;
  if (!has(key) || !YAML::convert<bool>::decode(tree_->root[key], value))
    throw wrong(key, "does not fit; true or false was expected");
  return value;
}

mrpt::img::TCamera make_camera(double width, double height, const std::vector<double>& fx_fy_cx_cy,
                               const std::vector<double>& distortion, const std::string& where) {
  const auto refuse = [&](const std::string& what) {
    return Error(ErrorCode::kBadInput, what, where, "correct the calibration");
  };
  const auto is_side = [](double side) { return side >= 1.0 && side <= kMostPixels && side == std::floor(side); };
  if (!is_side(width) || !is_side(height))
    throw refuse("the size of the pictures cannot be; 1 to 20000 whole pixels were expected");
  if (!(fx_fy_cx_cy[0] > 0.0 && fx_fy_cx_cy[1] > 0.0)) throw refuse("the focal lengths fx and fy must be above 0");
  mrpt::img::TCamera camera;
  camera.ncols = static_cast<std::uint32_t>(width);
  camera.nrows = static_cast<std::uint32_t>(height);
  camera.setIntrinsicParamsFromValues(fx_fy_cx_cy[0], fx_fy_cx_cy[1], fx_fy_cx_cy[2], fx_fy_cx_cy[3]);
  for (std::size_t i = 0; i < distortion.size(); ++i) {
    camera.dist.at(i) = distortion[i];  // MRPT's order too: k1 k2 p1 p2 k3
    if (distortion[i] != 0.0) camera.distortion = mrpt::img::DistortionModel::plumb_bob;
  }
  return camera;
}

mrpt::poses::CPose3D make_pose(const std::vector<double>& rows, const std::string& where) {
  Eigen::Matrix3d rotation;
  mrpt::math::CMatrixDouble44 pose;
  for (int row = 0; row < 4; ++row) {
    for (int column = 0; column < 4; ++column) {
      pose(row, column) = rows[static_cast<std::size_t>(4 * row + column)];
      if (row < 3 && column < 3) rotation(row, column) = pose(row, column);
    }
  }
  const Eigen::Matrix3d deviation = rotation * rotation.transpose() - Eigen::Matrix3d::Identity();
  const bool is_rotation = deviation.cwiseAbs().maxCoeff() < 1e-3 && rotation.determinant() > 0.0;
  if (!is_rotation || pose(3, 0) != 0.0 || pose(3, 1) != 0.0 || pose(3, 2) != 0.0 || pose(3, 3) != 1.0)
    throw Error(ErrorCode::kBadInput,
                "the pose is no rotation and translation; 4 x 4 numbers, row by row, were expected", where,
                "correct the calibration");
  return mrpt::poses::CPose3D(pose);
}

}  // namespace mapweave::rawlog
