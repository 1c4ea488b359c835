#include "page_text.h"

#include <mapweave/core/hash.h>

#include <map>

namespace mapweave::report {
namespace {

constexpr char kFileFooter[] = "Written by mapweave. This file holds everything that it shows and loads nothing.";
constexpr char kLiveFooter[] =
    "Shown by mapweave while it runs; this page asks that program alone. "
    "Also here: <a href=\"status.json\">status.json</a>, <a href=\"metrics\">metrics</a>, "
    "<a href=\"healthz\">healthz</a>.";

// As a content security policy names what it allows.
std::string policy_hash(const std::string& text) {
  const Hash hash = hash_of_bytes(text);
  return "sha256-" + base64({reinterpret_cast<const char*>(hash.bytes.data()), hash.bytes.size()});
}

// Replaces {{name}}; what is put in is not looked at again.
std::string filled_in(std::string_view text, const std::map<std::string, std::string>& values) {
  std::string result;
  while (true) {
    const std::size_t begin = text.find("{{"), end = text.find("}}", begin);
    if (begin == std::string_view::npos || end == std::string_view::npos) return result.append(text);
    result.append(text.substr(0, begin)).append(values.at(std::string(text.substr(begin + 2, end - begin - 2))));
    text.remove_prefix(end + 2);
  }
}

}  // namespace

std::string page_text(PageKind kind, const std::string& title, const Json& data) {
  const std::string style = std::string(page_style());
  const std::string script = "(() => {\n'use strict';\n" + page_script(kind) + "})();\n";
  return filled_in(page_template(), {{"title", html_escaped(title)},
                                     {"style", style},
                                     {"style hash", policy_hash(style)},
                                     {"script", script},
                                     {"script hash", policy_hash(script)},
                                     {"connections", kind == PageKind::live ? "; connect-src 'self'" : ""},
                                     {"footer", kind == PageKind::live ? kLiveFooter : kFileFooter},
                                     {"data", script_json(data)}});
}

}  // namespace mapweave::report
