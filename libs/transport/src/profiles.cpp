#include <mapweave/transport/profiles.h>

namespace mapweave::transport {

// What others measured, rounded: of one robot, upwards, with nobody else on the air.
//   lan   gigabit Ethernet: 941 Mbit/s of TCP
//   wifi  802.11ac at 5 GHz from a Raspberry Pi 3B+: 102 Mbit/s by iperf (Raspberry Pi Ltd., 14 March 2018)
//   4g    some 10 Mbit/s upwards, 25 ms one way
//   5g    non-standalone, some 50 Mbit/s upwards; 7 to 18 ms one way (Rohde & Schwarz, Munich, August 2022)
LinkState state_of(LinkProfile profile) {
  switch (profile) {
    case LinkProfile::none: break;
    case LinkProfile::lan: return {117.5e6, 0.0002, 0.00005, 0.0};
    case LinkProfile::wifi: return {12.75e6, 0.002, 0.002, 0.005};
    case LinkProfile::lte: return {1.25e6, 0.025, 0.008, 0.002};
    case LinkProfile::nr: return {6.25e6, 0.012, 0.004, 0.002};
  }
  return {};
}

// Estimates from clock and width, not measurements of this program: compare `cpu_seconds` of `mapweave slam` on one log
// on both machines.
//   Raspberry Pi 3B+  Cortex-A53, 1.4 GHz, two instructions a cycle in order (Arm's and Raspberry Pi's data sheets)
//   Jetson TX2        Cortex-A57, 2 GHz, three instructions a cycle out of order (NVIDIA's data sheet)
double speed_of(ProcessorProfile profile) {
  switch (profile) {
    case ProcessorProfile::this_machine: break;
    case ProcessorProfile::raspberry_pi_3b_plus: return 0.12;
    case ProcessorProfile::jetson_tx2: return 0.3;
  }
  return 1.0;
}

}  // namespace mapweave::transport
