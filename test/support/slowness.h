#pragma once
// How much slower programs are where a sanitizer watches them: tests against the clock wait longer, and drive slower.

namespace mapweave::test {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr int kSlowness = 6;
#else
inline constexpr int kSlowness = 1;
#endif

}  // namespace mapweave::test
