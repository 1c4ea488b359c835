#pragma once
// Lines of numbers, as trajectories and relations come: hostile text until read.

#include <mapweave/core/stamp.h>

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

  bool next();  // to the next line of numbers; false at the end
  double number(std::size_t column) const;
  Stamp stamp(std::size_t column) const;  // exact where it is written in decimals
  [[noreturn]] void fail(const std::string& what, const std::string& remedy = {}) const;

 private:
  std::string_view rest_;
  std::string where_, format_;
  std::size_t columns_, line_ = 0;
  std::vector<std::string_view> fields_;
};

}  // namespace mapweave::evaluation
