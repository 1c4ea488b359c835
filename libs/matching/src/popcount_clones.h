#pragma once
// Kernels of integers alone are compiled twice, and the loader takes the one that the processor has the instruction for. Sanitizers start
// too late for such a choice.

#if defined(__x86_64__) && !defined(__SANITIZE_ADDRESS__) && !defined(__SANITIZE_THREAD__)
#define MAPWEAVE_POPCOUNT_CLONES __attribute__((target_clones("popcnt", "default")))
#else
#define MAPWEAVE_POPCOUNT_CLONES
#endif
