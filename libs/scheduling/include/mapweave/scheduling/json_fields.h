#pragma once
// Reading JSON that strangers wrote: every refusal names file and key.

#include <nlohmann/json_fwd.hpp>

#include <initializer_list>
#include <string>
#include <string_view>

namespace mapweave::scheduling {

// Throws Error kCorrupt for what is not JSON, kBadInput for a key given twice.
nlohmann::json parse_json(std::string_view text, const std::string& where);

[[noreturn]] void refuse(const std::string& what, const std::string& where, const std::string& key,
                         const std::string& remedy);
// An object whose keys are all known; an unknown one is refused with the nearest name.
void expect_object(const nlohmann::json&, std::initializer_list<const char*> known, const std::string& where,
                   const std::string& key);
const nlohmann::json& member(const nlohmann::json& object, const char* name, const std::string& where,
                             const std::string& key);
// A finite number in [low, high]; above_low: low itself is refused.
double number(const nlohmann::json&, double low, double high, bool above_low, const std::string& where,
              const std::string& key);
// Of the object's field `name`, in [0, most].
double field(const nlohmann::json& object, const char* name, double most, const std::string& where,
             const std::string& key);
std::string name(const nlohmann::json&, const std::string& where, const std::string& key);  // is_valid_name

}  // namespace mapweave::scheduling
