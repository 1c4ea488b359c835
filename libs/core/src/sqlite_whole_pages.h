#pragma once

namespace mapweave {

// The name of a way to open files (sqlite3_vfs) by which each ends with its last whole page: SQLite takes what is
// missing of a page that was cut for zeros, and answers them as data. For reading alone.
const char* whole_pages_of_files();

}  // namespace mapweave
