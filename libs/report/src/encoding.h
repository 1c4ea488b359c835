#pragma once
// Texts and bytes as they stand in the page.

#include <nlohmann/json.hpp>

#include <string>
#include <string_view>

namespace mapweave::report {

using Json = nlohmann::ordered_json;

std::string base64(std::string_view bytes);
// "data:image/png;base64,..."; `kind`: png, jpeg.
std::string data_url(std::string_view kind, std::string_view bytes);

// For text and attributes of HTML.
std::string html_escaped(std::string_view text);
// JSON that can stand in a script element: no '<', '>' or '&', ASCII alone; bytes that are no UTF-8 become U+FFFD.
std::string script_json(const Json&);

// To so many digits behind the point; null for what is no finite number.
Json rounded(double value, int digits);
// Numbers and all within arrays and objects; everything else as it is.
Json rounded(const Json&, int digits);

}  // namespace mapweave::report
