#pragma once
// A model of a wire that messages of known size go over, in virtual time: when does the last byte arrive? Carries
// nothing. For runs whose tiers share a process but not, in what is reported of them, a place.

#include <mapweave/core/options.h>
#include <mapweave/transport/profiles.h>

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace mapweave::transport {

struct LinkModelOptions {
  LinkProfile profile = LinkProfile::none;
  double bytes_per_s = 0.0, delay_s = 0.0, jitter_s = 0.0, loss = 0.0;
  std::string trace;

  template <class Visitor>
  void describe(Visitor& v) {
    v.choice(
        "profile", profile,
        {{"none", LinkProfile::none},
         {"lan", LinkProfile::lan},
         {"wifi", LinkProfile::wifi},
         {"4g", LinkProfile::lte},
         {"5g", LinkProfile::nr}},
        "kind of network link, with a typical bandwidth, delay, jitter and loss; none: everything arrives at once");
    v.non_negative(
        "bytes_per_s", bytes_per_s,
        "bandwidth of the link in bytes per second; larger values let messages arrive sooner; 0: as the profile says");
    v.non_negative(
        "delay_s", delay_s,
        "one-way delay of a packet in seconds; larger values let messages arrive later; 0: as the profile says");
    v.non_negative("jitter_s", jitter_s,
                   "standard deviation in seconds of the random part that is added to each packet's delay; larger "
                   "values let messages arrive less regularly; 0: as the profile says");
    v.number("loss", loss, 0.0, 0.9,
             "share of packets that are lost and sent again a round trip later; larger values let messages arrive "
             "later; 0: as the profile says");
    v.text("trace", trace,
           "file with lines `seconds,bytes_per_s[,delay_s[,jitter_s[,loss]]]` that gives the link's state over time, "
           "repeated after its "
           "last line; empty: the state is constant");
  }
};

// The profile, with the numbers that are given instead of its own.
LinkState state_of(const LinkModelOptions&);

// What a link is like from a time on. It begins again where the last entry begins, which says no more than that; a
// single entry lasts.
struct LinkTrace {
  std::vector<double> from_s;  // rising, from 0
  std::vector<LinkState> states;
};
// What a line leaves out is as in `otherwise`. Throws Error: kMissing without such a file, kBadInput with the line of
// one that is none.
LinkTrace read_link_trace(const std::filesystem::path&, const LinkState& otherwise);

// Messages leave in the order in which they are handed over and arrive in it; what is lost is sent again a round trip
// later. Not thread-safe. The same numbers for the same seed.
class LinkModel {
 public:
  LinkModel(LinkState state, std::uint64_t seed) : LinkModel(LinkTrace{{0.0}, {state}}, seed) {}
  LinkModel(LinkTrace trace, std::uint64_t seed);
  // The profile, numbers and trace of the options; throws what reading the trace throws.
  LinkModel(const LinkModelOptions&, std::uint64_t seed);

  // When the last byte arrives of a message that is handed over at a time, which is never earlier than that of the
  // last.
  double send(double at_s, std::size_t bytes);
  LinkState state_at(double at_s) const { return span_at(at_s).state; }

 private:
  struct Span {
    const LinkState& state;
    double until_s;
  };
  Span span_at(double at_s) const;
  double left(double at_s, double bytes) const;  // when so many bytes have left that begin to
  double uniform();                              // [0, 1)

  LinkTrace trace_;
  std::uint64_t seed_, drawn_ = 0;
  double free_s_ = 0.0, arrived_s_ = 0.0;
};

}  // namespace mapweave::transport
