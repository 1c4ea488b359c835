#pragma once
// Sorts and checks what a format's reader gives.

#include "record_source.h"

namespace mapweave::rawlog {

std::unique_ptr<ObservationStream> make_ordered_stream(std::unique_ptr<RecordSource> source,
                                                       const ReadOptions& options);

}  // namespace mapweave::rawlog
