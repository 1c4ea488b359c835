#pragma once
// Lines of numbers, as trajectories and relations come: hostile text until read.

#include <mapweave/core/stamp.h>

#include <Eigen/Geometry>

#include <string>
#include <string_view>
#include <vector>

namespace mapweave::evaluation {

// Walks over the lines that hold numbers; blank lines and what follows `#` are passed over. Every complaint is an
// Error(kBadInput) at "where:line".
class NumberLines {
 public:
  // `text` must outlive it. `format`: what a line should hold, for messages; as many words as columns.
  NumberLines(std::string_view text, std::string where, std::string format);

  static std::size_t columns_of(std::string_view line);
  bool next();  // to the next line of numbers; false at the end
  double number(std::size_t column) const;
  Stamp stamp(std::size_t column) const;  // exact where it is written in decimals
  Stamp nanoseconds(std::size_t column) const;
  [[noreturn]] void fail(const std::string& what, const std::string& remedy = {}) const;

 private:
  std::string_view rest_;
  std::string where_, format_;
  std::size_t columns_, line_ = 0;
  std::vector<std::string_view> fields_;
};

// Normalised; complains, with `remedy`, where the length is not 1 within 0.01.
Eigen::Quaterniond unit_quaternion(const Eigen::Quaterniond&, const NumberLines&, const std::string& remedy);

}  // namespace mapweave::evaluation
