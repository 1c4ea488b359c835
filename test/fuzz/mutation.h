#pragma once
// Hostile inputs made of sound ones, the same ones each time.

#include <random>
#include <string>
#include <vector>

namespace mapweave::fuzz {

// One to eight changes of one of the seeds: bits, bytes, numbers and digits changed; pieces cut out, doubled, moved in
// from another seed; or cut short.
std::string mutated(const std::vector<std::string>& seeds, std::mt19937_64& random);

}  // namespace mapweave::fuzz
