#pragma once
// What a receiver answers: what it has, or why it takes nothing. Byte forms: as exchange.h.

#include <mapweave/core/error.h>
#include <mapweave/maps/map_update.h>

#include <string>
#include <string_view>
#include <vector>

namespace mapweave {

// What a receiver has of one origin: so much that it cannot lose it. The sender forgets that, and repeats what is
// awaited.
struct Receipt {
  Origin origin;
  std::uint64_t stored = 0;   // every update up to this one
  std::uint64_t awaited = 0;  // 0, or the number of the update that is missing: later ones have come
};

std::string encode(const std::vector<Receipt>&);
std::vector<Receipt> decode_receipts(std::string_view bytes, const std::string& where);

// Why a message was not taken.
struct Refusal {
  Error why;
};

std::string encode(const Refusal&);
Refusal decode_refusal(std::string_view bytes, const std::string& where);

}  // namespace mapweave
