#include <mapweave/runtime/memory.h>

#include <cstdlib>
#ifdef __GLIBC__
#include <malloc.h>
#endif

namespace mapweave::runtime {

void limit_kept_memory() {
#ifdef __GLIBC__
  constexpr int kLargeBlock = 4 << 20, kMostFree = 64 << 20, kFetched = 16 << 20;
  mallopt(M_MMAP_THRESHOLD, kLargeBlock);
  mallopt(M_TRIM_THRESHOLD, kMostFree);
  mallopt(M_TOP_PAD, kFetched);
#endif
}

void return_free_memory() {
#ifdef __GLIBC__
  malloc_trim(0);
#endif
}

}  // namespace mapweave::runtime
