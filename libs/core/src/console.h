#pragma once
// The one writer to stderr: log and progress share it, so that no line lands in the middle of another.

#include <string_view>

namespace mapweave::console {

bool is_terminal();
bool shows_progress();                   // where lines of the level info are logged
int columns();                           // of the terminal; 80 where unknown
void write_line(std::string_view line);  // stays; the live line moves below it
void show_live(std::string_view line);   // replaces the live line (terminals only); empty: none

}  // namespace mapweave::console
