#pragma once

#include "encoding.h"
#include "page_files.h"

#include <string>

namespace mapweave::report {

// The whole page. Its policy allows its own style and script by their hashes, and pictures within the file; nothing
// else; of a live page its own server as well.
std::string page_text(PageKind, const std::string& title, const Json& data);

}  // namespace mapweave::report
