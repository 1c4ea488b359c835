#include <mapweave/core/ids.h>

#include <mutex>
#include <set>
#include <shared_mutex>

namespace mapweave {
namespace {

struct NameTable {
  std::shared_mutex mutex;
  std::set<std::string, std::less<>> texts;  // addresses of its elements stay valid
};

std::string text_of_nanoseconds(std::int64_t ns) {
  // Milliseconds, cut: a name for people. Unsigned, since the most negative value has no positive counterpart.
  const std::uint64_t magnitude = ns < 0 ? ~static_cast<std::uint64_t>(ns) + 1 : static_cast<std::uint64_t>(ns);
  std::string fraction = std::to_string(magnitude / 1'000'000 % 1000);
  fraction.insert(0, 3 - fraction.size(), '0');
  return (ns < 0 ? "-" : "") + std::to_string(magnitude / 1'000'000'000) + "." + fraction;
}

}  // namespace

template <class Tag>
const std::string* Name<Tag>::intern(std::string_view text) {
  // Never destroyed: names may be used by destructors of static objects.
  static NameTable& table = *new NameTable;
  static const std::string* const empty = &*table.texts.emplace().first;
  if (text.empty()) return empty;
  {
    const std::shared_lock lock(table.mutex);
    const auto found = table.texts.find(text);
    if (found != table.texts.end()) return &*found;
  }
  const std::unique_lock lock(table.mutex);
  return &*table.texts.emplace(text).first;
}

template class Name<RobotTag>;
template class Name<SensorTag>;
template class Name<TierTag>;
template class Name<MapTag>;

std::string to_string(const SessionId& id) {
  return id.client.robot.str() + "/" + id.client.sensor.str() + "@" + text_of_nanoseconds(id.run);
}
std::string to_string(const NodeId& id) { return to_string(id.session) + "/node " + std::to_string(id.index); }
std::string to_string(const SubmapId& id) { return to_string(id.session) + "/submap " + std::to_string(id.index); }

bool is_valid_name(std::string_view text) {
  if (text.empty() || text.size() > 64 || text.front() == '.') return false;
  for (const char c : text) {
    const bool letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
    const bool digit = c >= '0' && c <= '9';
    if (!letter && !digit && c != '_' && c != '-' && c != '.') return false;
  }
  return true;
}

}  // namespace mapweave
