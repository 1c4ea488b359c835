#pragma once
// A channel between two threads of one process.

#include <mapweave/transport/channel.h>

#include <memory>

namespace mapweave::transport {

// Of what one end has sent and the other not acknowledged. A longer message than all of it is never taken.
struct ChannelLimits {
  std::size_t bytes = std::size_t{1} << 40;
  std::size_t messages = std::size_t{1} << 20;
};

// Both ends; letting go of one closes the channel. What was sent before may still be received.
struct InProcessChannel {
  std::shared_ptr<Channel> first, second;
};
InProcessChannel make_in_process_channel(ChannelLimits from_first = {}, ChannelLimits from_second = {});

}  // namespace mapweave::transport
