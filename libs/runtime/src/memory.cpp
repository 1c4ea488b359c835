#include <mapweave/runtime/memory.h>

#include <cstdlib>
#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace mapweave::runtime {

void return_large_blocks() {
#ifdef __GLIBC__
  constexpr int kBytes = 128 * 1024;
  mallopt(M_MMAP_THRESHOLD, kBytes);
  mallopt(M_TRIM_THRESHOLD, kBytes);
#endif
}

void keep_room_for_pictures() {
#ifdef __GLIBC__
  constexpr int kBytes = 2 * 1024 * 1024;
  mallopt(M_TOP_PAD, kBytes);
#endif
}

void return_free_memory() {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}

}  // namespace mapweave::runtime
