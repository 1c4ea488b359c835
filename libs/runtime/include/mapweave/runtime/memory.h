#pragma once
// How much freed memory a program keeps. Changes no result.

namespace mapweave::runtime {

// Once, by a program, before it begins: blocks of 4 MB and more go back to the system as soon as they are freed; of
// smaller ones up to 64 MB stay, since rasters and pictures come and go, and fetching their pages anew takes up to
// half of the time. (glibc by itself learns to keep blocks of up to 32 MB, and a mapper's grown rasters leave holes.)
void limit_kept_memory();

// After something large has ended: gives back what is free among small blocks too.
void return_free_memory();

}  // namespace mapweave::runtime
