#pragma once
// How any message of proto/mapweave.proto's Exchange is written and read.

#include "form.h"

#include <optional>

namespace mapweave {

// With its version and the sessions that it names.
std::string written(form::Exchange& form, const SessionTable& sessions = {});
// Throws Error(kCorrupt) for what is no Exchange with this content (any, where none is given), kUnsupported for a newer
// one. The reader knows its sessions then.
form::Exchange read_exchange(std::string_view bytes, FormReader& reader, const std::string& where,
                             std::optional<form::Exchange::ContentCase> content);

Sensed sensed_of(const form::Sensed& content, FormReader& reader);

// Names that have to be there.
template <class Name>
Name name_in(const std::string& text, const char* of_what, const FormReader& reader) {
  if (text.empty()) reader.corrupt("it names no " + std::string(of_what));
  return Name(reader.name_or_nothing(text, of_what));
}
template <class Name>
void expect_name(const Name& name, const char* of_what) {
  MAPWEAVE_EXPECT(is_valid_name(name.str()), "a message names a " + std::string(of_what));
}

// An error, in the four fields that a message has for it; code 0 is left to who has none.
template <class Form>
void fill_error(Form& form, const Error& error) {
  form.set_code(1 + static_cast<std::uint32_t>(error.code()));
  form.set_problem(error.problem());
  form.set_where(error.where());
  form.set_remedy(error.remedy());
}
template <class Form>
Error error_of(const Form& form, const FormReader& reader) {
  if (form.code() == 0 || form.code() > 1 + static_cast<std::uint32_t>(ErrorCode::kInternal))
    reader.corrupt("an error of no known kind");
  return Error(static_cast<ErrorCode>(form.code() - 1), form.problem(), form.where(), form.remedy());
}

}  // namespace mapweave
