#include "client_wire.h"

#include <algorithm>

namespace mapweave::runtime {

void add(ClientCounts& sum, const ClientCounts& more) {
  sum.received_bytes += more.received_bytes;
  sum.sent_bytes += more.sent_bytes;
  sum.updates += more.updates;
  sum.views += more.views;
  sum.shares += more.shares;
  sum.places += more.places;
  sum.refused += more.refused;
  sum.update_s += more.update_s;
  sum.retrieval_s += more.retrieval_s;
  sum.sending_s += more.sending_s;
  sum.place_s += more.place_s;
  sum.waited_s += more.waited_s;
  sum.longest_wait_s = std::max(sum.longest_wait_s, more.longest_wait_s);
  sum.longest_place_s = std::max(sum.longest_place_s, more.longest_place_s);
}

}  // namespace mapweave::runtime
