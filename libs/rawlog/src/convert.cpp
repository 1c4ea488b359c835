#include <mapweave/rawlog/convert.h>
#include <mapweave/rawlog/rawlog_writer.h>

#include "task.h"

namespace mapweave::rawlog {

std::uint64_t convert_log(const std::filesystem::path& log, const std::filesystem::path& out, Progress& progress,
                          const ReadOptions& options) {
  const auto stream = open_log(log, options);
  RawlogWriter writer(out);
  Task task(progress, "converting " + log.filename().string(), *stream);
  while (const auto record = stream->next()) {
    writer.add(*record->observation);
    task.step();
  }
  writer.close();
  return writer.count();
}

}  // namespace mapweave::rawlog
