#pragma once
// What comes out of a bag, for the tests of its readers, and the recordings below test/data/ros2.

#include "logs.h"

#include <ros/bag_reader.h>
#include <ros/message_reader.h>

#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace mapweave::rawlog::ros {

using Opener = std::function<std::unique_ptr<BagReader>()>;

struct BagReading {
  std::vector<BagTopic> topics;  // at the end
  std::vector<BagMessage> messages;
  std::vector<std::string> lines;  // "/scan 100.01 100 5": topic, received, stamp, last range; "/note 100.06 note 0"
  std::unique_ptr<Error> error;
};

inline std::string decoded_line(const BagTopic& topic, const BagMessage& message) {
  MessageReader fields(message.data, topic.encoding);
  const auto text = [](double number) {
    std::string digits = std::to_string(number);
    digits.erase(digits.find_last_not_of('0') + 1);
    return digits.back() == '.' ? digits.substr(0, digits.size() - 1) : digits;
  };
  const std::string start = topic.name + " " + text(static_cast<double>(message.received_ns) * 1e-9) + " ";
  if (topic.type == "std_msgs/String") return start + std::string(fields.string());
  const MessageHeader header = fields.header();
  fields.skip<float>(7);
  const auto ranges = fields.sequence<float>();
  if (ranges.empty()) return start + "no ranges";
  return start + text(static_cast<double>(header.stamp_ns) * 1e-9) + " " + text(static_cast<double>(ranges.back()));
}

inline std::string line_of(const BagTopic& topic, const BagMessage& message) {
  try {
    return decoded_line(topic, message);
  } catch (const Error& error) {
    return "damaged: " + error.problem();
  }
}

inline BagReading read_bag(const Opener& open, const std::vector<std::size_t>& select = {}) {
  BagReading reading;
  try {
    const auto bag = open();
    if (!select.empty()) bag->select(select);
    BagMessage message;
    try {
      while (bag->next(message)) {
        reading.lines.push_back(line_of(bag->topics().at(message.topic), message));
        reading.messages.push_back(message);
      }
    } catch (const Error&) {
      reading.topics = bag->topics();
      throw;
    }
    reading.topics = bag->topics();
  } catch (const Error& error) {
    reading.error = std::make_unique<Error>(error);
  }
  return reading;
}

// What each of the recordings holds, as make_recordings.py wrote it.
inline std::vector<std::string> recorded_lines() {
  return {"/scan 100.01 100 5",   "/note 100.06 note 0", "/scan 100.11 100.1 6",
          "/scan 100.21 100.2 7", "/note 100.26 note 1", "/scan 100.31 100.3 8",
          "/scan 100.41 100.4 9", "/note 100.46 note 2", "/scan 100.51 100.5 10"};
}

inline std::string text_of(const std::vector<BagTopic>& topics) {
  std::string text;
  for (const BagTopic& topic : topics)
    text += topic.name + " " + topic.type + (topic.encoding == MessageEncoding::cdr ? " cdr " : " ros1 ") +
            std::to_string(topic.messages) + "\n";
  return text;
}

// Whether `lines` are what stands first in the whole recording.
MATCHER(IsBeginningOfRecording, "") {
  const auto whole = recorded_lines();
  return arg.size() <= whole.size() && std::equal(arg.begin(), arg.end(), whole.begin());
}

}  // namespace mapweave::rawlog::ros
