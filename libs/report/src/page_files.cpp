#include "page_files.h"

#include <cstddef>

// The bytes of the files become part of the library, so that no program has to know where they lie.
#define MAPWEAVE_PAGE_FILE(name) "    .incbin \"" MAPWEAVE_REPORT_PAGE name "\"\n"
#define MAPWEAVE_PAGE_LABEL(name) "    .globl mapweave_page_" name "\nmapweave_page_" name ":\n"
asm("    .section .rodata\n" MAPWEAVE_PAGE_LABEL("template") MAPWEAVE_PAGE_FILE("page.html")
        MAPWEAVE_PAGE_LABEL("style") MAPWEAVE_PAGE_FILE("page.css") MAPWEAVE_PAGE_LABEL("shared")
            MAPWEAVE_PAGE_FILE("basics.js") MAPWEAVE_PAGE_FILE("charts.js") MAPWEAVE_PAGE_FILE("timeline_section.js")
                MAPWEAVE_PAGE_FILE("again_section.js") MAPWEAVE_PAGE_LABEL("run") MAPWEAVE_PAGE_FILE("viewport.js")
                    MAPWEAVE_PAGE_FILE("map_layers.js") MAPWEAVE_PAGE_FILE("replay.js")
                        MAPWEAVE_PAGE_FILE("map_section.js") MAPWEAVE_PAGE_LABEL("rest_of_run")
                            MAPWEAVE_PAGE_FILE("pairs.js") MAPWEAVE_PAGE_FILE("points_section.js")
                                MAPWEAVE_PAGE_FILE("sections.js") MAPWEAVE_PAGE_LABEL("plan")
                                    MAPWEAVE_PAGE_FILE("plan_section.js") MAPWEAVE_PAGE_LABEL("live")
                                        MAPWEAVE_PAGE_FILE("live_section.js") MAPWEAVE_PAGE_LABEL("main")
                                            MAPWEAVE_PAGE_FILE("main.js") MAPWEAVE_PAGE_LABEL("end") "    .text\n");
extern "C" const char mapweave_page_template[], mapweave_page_style[], mapweave_page_shared[], mapweave_page_run[],
    mapweave_page_rest_of_run[], mapweave_page_plan[], mapweave_page_live[], mapweave_page_main[], mapweave_page_end[];

namespace mapweave::report {
namespace {

std::string_view between(const char* begin, const char* end) { return {begin, static_cast<std::size_t>(end - begin)}; }

}  // namespace

std::string_view page_template() { return between(mapweave_page_template, mapweave_page_style); }
std::string_view page_style() { return between(mapweave_page_style, mapweave_page_shared); }
std::string page_script(PageKind kind) {
  std::string script(between(mapweave_page_shared, mapweave_page_run));
  switch (kind) {
    case PageKind::run: script += between(mapweave_page_run, mapweave_page_plan); break;
    case PageKind::plan: script += between(mapweave_page_plan, mapweave_page_live); break;
    case PageKind::live:
      script += between(mapweave_page_run, mapweave_page_rest_of_run);
      script += between(mapweave_page_live, mapweave_page_main);
      break;
  }
  return script.append(between(mapweave_page_main, mapweave_page_end));
}

}  // namespace mapweave::report
