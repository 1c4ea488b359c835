#pragma once
// What the page consists of beside its data: libs/report/page.

#include <string>
#include <string_view>

namespace mapweave::report {

enum class PageKind { run, plan, live };  // what the page shows

std::string_view page_template();  // its {{...}} are what page_text() puts in
std::string_view page_style();
std::string page_script(PageKind);

}  // namespace mapweave::report
