#include "exchange_form.h"

#include <mapweave/maps/receipt.h>

namespace mapweave {
namespace {

bool is_sound(const Receipt& receipt) { return receipt.awaited == 0 || receipt.awaited > receipt.stored; }

}  // namespace

std::string encode(const std::vector<Receipt>& receipts) {
  form::Exchange form;
  form.mutable_receipts();
  for (const Receipt& receipt : receipts) {
    expect_name(receipt.origin.map, "map");
    MAPWEAVE_EXPECT(is_sound(receipt), "what is awaited is not stored");
    auto& line = *form.mutable_receipts()->add_receipts();
    line.set_tier(receipt.origin.tier.str());
    line.set_map(receipt.origin.map.str());
    line.set_stored(receipt.stored);
    line.set_awaited(receipt.awaited);
  }
  return written(form);
}

std::vector<Receipt> decode_receipts(std::string_view bytes, const std::string& where) {
  FormReader reader(where);
  const auto form = read_exchange(bytes, reader, where, form::Exchange::kReceipts);
  std::vector<Receipt> receipts;
  for (const auto& line : form.receipts().receipts()) {
    receipts.push_back(
        {{TierId(reader.name_or_nothing(line.tier(), "tier")), name_in<MapId>(line.map(), "map", reader)},
         line.stored(),
         line.awaited()});
    if (!is_sound(receipts.back())) reader.corrupt("an update is awaited that is stored");
  }
  return receipts;
}

std::string encode(const Refusal& refusal) {
  form::Exchange form;
  fill_error(*form.mutable_refusal(), refusal.why);
  return written(form);
}

Refusal decode_refusal(std::string_view bytes, const std::string& where) {
  FormReader reader(where);
  return {error_of(read_exchange(bytes, reader, where, form::Exchange::kRefusal).refusal(), reader)};
}

}  // namespace mapweave
