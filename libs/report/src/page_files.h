#pragma once
// What the page consists of beside its data: libs/report/page.

#include <string>
#include <string_view>

namespace mapweave::report {

enum class PageKind { run, plan };  // what the page shows

std::string_view page_template();  // with {{title}}, {{style}}, {{script}}, {{data}} and the hashes of style and script
std::string_view page_style();
std::string page_script(PageKind);

}  // namespace mapweave::report
