#pragma once
// What one format's reader gives: records as they stand in the file. Sorting and checking are done once for all formats
// (ordered_stream.h).

#include <mapweave/rawlog/observation_stream.h>

#include <exception>
#include <string>
#include <vector>

namespace mapweave::rawlog {

struct PlacedRecord {
  Record record;
  std::uint64_t place = 0;  // byte or line, as place_name() says
};

class RecordSource {
 public:
  // Adds the next records of the file, none or several; false at its clean end. Throws Error; what was added before is
  // good.
  virtual bool read(std::vector<PlacedRecord>& records) = 0;
  // What to report of an error in the records: the error, or what the rest of the file shows to be its cause. Ends the
  // reading.
  virtual std::exception_ptr cause_of(std::exception_ptr seen) { return seen; }
  virtual std::string place_name(std::uint64_t place) const = 0;  // "a.log:17"
  virtual std::string path() const = 0;
  virtual bool is_in_order() const { return false; }  // stamps never go back, so nothing need wait to be sorted in
  virtual std::string nothing_found() const { return {}; }  // what was there instead of observations
  virtual std::uint64_t bytes_read() const = 0;
  virtual std::uint64_t bytes_total() const = 0;
  virtual ~RecordSource() = default;
};

}  // namespace mapweave::rawlog
