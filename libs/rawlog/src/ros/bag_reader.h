#pragma once

#include <cstddef>
#include <cstdint>
#include <string>
#include <vector>

namespace mapweave::rawlog::ros {

/** How the bytes of a message are laid out: ROS 1's packed little-endian form, or ROS 2's CDR. */
enum class MessageEncoding { ros1, cdr };

struct BagTopic {
  std::string name;
  /** "sensor_msgs/LaserScan", in bags of both generations: ROS 2's "sensor_msgs/msg/LaserScan" stands here without
   * "msg/". */
  std::string type;
  MessageEncoding encoding = MessageEncoding::ros1;
  /** Number of messages; 0 where the bag has no index. */
  std::uint64_t messages = 0;
};

struct BagMessage {
  /** Index into BagReader::topics(). */
  std::size_t topic = 0;
  /** When the recorder received the message, ns since 1970. */
  std::int64_t received_ns = 0;
  /** The message as it was serialized. */
  std::vector<std::byte> data;
  /** Byte in the file, or id of the row, for BagReader::place_name(). */
  std::uint64_t place = 0;
};

/** Reads the messages of a bag: one file, or several parts of one recording. For one thread.
 *
 * Messages come in the order in which they were received as well as the file allows it: chunk by chunk, not sorted over
 * the whole file. */
class BagReader {
 public:
  virtual ~BagReader() = default;

  /** May grow while the bag is read, where it has no index. */
  [[nodiscard]] virtual const std::vector<BagTopic>& topics() const = 0;

  /** Delivers only messages of these topics (indices into topics()) from now on. Others are skipped as cheaply as the
   * format allows. */
  virtual void select(const std::vector<std::size_t>& topics) = 0;

  /** Reads the next message. False at the clean end of the bag.
   * @throws Error with place and remedy at damage; what was delivered before is good. */
  virtual bool next(BagMessage& message) = 0;

  /** A place for error messages, such as "byte 4711 of robot.bag". */
  [[nodiscard]] virtual std::string place_name(std::uint64_t place) const = 0;

  /** What else may be the reason where a message that was delivered makes no sense; empty where nothing is known. */
  [[nodiscard]] virtual std::string doubt() const { return {}; }

  [[nodiscard]] virtual std::uint64_t bytes_read() const = 0;
  [[nodiscard]] virtual std::uint64_t bytes_total() const = 0;
};

}  // namespace mapweave::rawlog::ros
