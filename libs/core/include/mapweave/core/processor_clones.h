#pragma once
// Functions that are compiled twice, and of which the loader takes the one that the processor has the instructions for.
// Only for what gives the same bytes either way: integers, and lanes that each do the same operations in the same
// order. Sanitizers start too late for such a choice. The thread sanitizer leaves these functions alone: each works on
// what its caller owns, and it would take most of its time there.

#if defined(__SANITIZE_THREAD__)
#define MAPWEAVE_POPCOUNT_CLONES __attribute__((no_sanitize("thread")))
#define MAPWEAVE_WIDE_CLONES __attribute__((no_sanitize("thread")))
#elif defined(__x86_64__) && !defined(__SANITIZE_ADDRESS__)
#define MAPWEAVE_POPCOUNT_CLONES __attribute__((target_clones("popcnt", "default")))
#define MAPWEAVE_WIDE_CLONES __attribute__((target_clones("avx2", "default")))
#else
#define MAPWEAVE_POPCOUNT_CLONES
#define MAPWEAVE_WIDE_CLONES
#endif
