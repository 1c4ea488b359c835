#pragma once
// What common wires and processors are like, for runs whose tiers share a machine. Figures and their sources:
// src/profiles.cpp.

namespace mapweave::transport {

// How a wire is from a time on. Numbers are of one direction.
struct LinkState {
  double bytes_per_s = 0.0;              // 0: any number at once
  double delay_s = 0.0, jitter_s = 0.0;  // of a packet: at least; standard deviation of what comes on top
  double loss = 0.0;                     // share of packets that are lost and sent again
};

enum class LinkProfile { none, lan, wifi, lte, nr };  // lte: 4G; nr: 5G
LinkState state_of(LinkProfile);

enum class ProcessorProfile { this_machine, raspberry_pi_3b_plus, jetson_tx2 };
double speed_of(ProcessorProfile);  // of one core, in cores of a server at 2.8 GHz; this machine: 1

}  // namespace mapweave::transport
