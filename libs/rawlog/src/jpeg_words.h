#pragma once
// libjpeg says what is wrong with a picture on stderr, without its name.

#include <string>

namespace mapweave::rawlog {

// While it lives, what libjpeg says in this thread is a warning that names the picture, once.
class PictureNamedToJpeg {
 public:
  explicit PictureNamedToJpeg(const std::string& name);
  ~PictureNamedToJpeg();
  PictureNamedToJpeg(const PictureNamedToJpeg&) = delete;
  PictureNamedToJpeg& operator=(const PictureNamedToJpeg&) = delete;
};

}  // namespace mapweave::rawlog
