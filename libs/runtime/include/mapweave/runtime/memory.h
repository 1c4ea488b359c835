#pragma once
// Keeps the resident size near to what is in use. Changes no result.

namespace mapweave::runtime {

// Once, by a program, before it begins: large blocks go back to the system as soon as they are freed. (glibc learns
// otherwise to keep blocks of up to 32 MB, and a mapper's grown rasters then leave holes: 320 instead of 245 MB on MIT
// Killian Court.)
void return_large_blocks();

// Before cameras' frames are read, from any thread: 2 MB stay free of each thread's memory. Pictures come and go with
// every frame, and fetching their pages anew took a tenth of the time.
void keep_room_for_pictures();

// After something large has ended: gives back what is free among small blocks too.
void return_free_memory();

}  // namespace mapweave::runtime
