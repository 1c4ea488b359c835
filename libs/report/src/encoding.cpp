#include "encoding.h"

#include <cmath>
#include <cstdint>

namespace mapweave::report {

std::string base64(std::string_view bytes) {
  static constexpr char kLetters[] = "ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
  std::string text;
  text.reserve((bytes.size() + 2) / 3 * 4);
  for (std::size_t i = 0; i < bytes.size(); i += 3) {
    std::uint32_t group = 0;
    for (std::size_t j = 0; j < 3; ++j)
      group = group << 8 | (i + j < bytes.size() ? static_cast<unsigned char>(bytes[i + j]) : 0u);
    for (std::size_t j = 0; j < 4; ++j) text += i + j < bytes.size() + 1 ? kLetters[group >> (18 - 6 * j) & 63] : '=';
  }
  return text;
}

std::string data_url(std::string_view kind, std::string_view bytes) {
  return "data:image/" + std::string(kind) + ";base64," + base64(bytes);
}

std::string html_escaped(std::string_view text) {
  std::string escaped;
  for (const char letter : text) {
    switch (letter) {
      case '&': escaped += "&amp;"; break;
      case '<': escaped += "&lt;"; break;
      case '>': escaped += "&gt;"; break;
      case '"': escaped += "&quot;"; break;
      case '\'': escaped += "&#39;"; break;
      default: escaped += letter;
    }
  }
  return escaped;
}

std::string script_json(const Json& json) {
  const std::string text = json.dump(-1, ' ', true, Json::error_handler_t::replace);
  std::string escaped;
  escaped.reserve(text.size());
  for (const char letter : text) {  // these stand within strings only
    switch (letter) {
      case '<': escaped += "\\u003c"; break;
      case '>': escaped += "\\u003e"; break;
      case '&': escaped += "\\u0026"; break;
      default: escaped += letter;
    }
  }
  return escaped;
}

Json rounded(double value, int digits) {
  if (!std::isfinite(value)) return {};
  const double unit = std::pow(10.0, digits), scaled = std::round(value * unit);
  if (scaled == 0.0) return 0;
  if (std::abs(scaled) < 9e15 && std::fmod(scaled, unit) == 0.0) return static_cast<std::int64_t>(scaled / unit);
  return scaled / unit;
}

Json rounded(const Json& json, int digits) {
  if (json.is_number_float()) return rounded(json.get<double>(), digits);
  if (!json.is_structured()) return json;
  Json result = json;
  for (Json& item : result) item = rounded(item, digits);
  return result;
}

}  // namespace mapweave::report
