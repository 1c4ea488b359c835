#include "jpeg_words.h"

#include <cstddef>
#include <cstdio>

#include <dlfcn.h>
#include <jpeglib.h>
#include <mapweave/core/log.h>

namespace mapweave::rawlog {
namespace {

thread_local const std::string* named = nullptr;

void say(j_common_ptr decoder) {
  char words[JMSG_LENGTH_MAX] = "";
  decoder->err->format_message(decoder, words);
  if (named == nullptr) {
    log(LogLevel::warning, std::string("a picture is damaged (") + words + ")");
  } else if (!named->empty()) {
    log(LogLevel::warning, *named + ": the picture is damaged (" + words + "): what is missing of it is grey");
    static const std::string said;
    named = &said;
  }
}

}  // namespace

PictureNamedToJpeg::PictureNamedToJpeg(const std::string& name) { named = &name; }
PictureNamedToJpeg::~PictureNamedToJpeg() { named = nullptr; }

}  // namespace mapweave::rawlog

// OpenCV decodes with libjpeg's standard error manager and offers no way to another one. Shared libraries find this
// function before libjpeg's own, which it calls.
extern "C" __attribute__((visibility("default"))) jpeg_error_mgr* jpeg_std_error(jpeg_error_mgr* manager) {
  using Original = jpeg_error_mgr* (*)(jpeg_error_mgr*);
  static const auto original = reinterpret_cast<Original>(::dlsym(RTLD_NEXT, "jpeg_std_error"));
  original(manager);
  manager->output_message = mapweave::rawlog::say;
  return manager;
}
