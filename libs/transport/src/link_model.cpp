#include <mapweave/core/error.h>
#include <mapweave/core/files.h>
#include <mapweave/core/mixed_bits.h>
#include <mapweave/transport/link_model.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <queue>
#include <sstream>

namespace mapweave::transport {
namespace {

constexpr double kPacketBytes = 1400.0;
constexpr double kLeastRetry_s = 1e-3;

LinkTrace trace_of(const LinkModelOptions& options) {
  if (options.trace.empty()) return {{0.0}, {state_of(options)}};
  return read_link_trace(options.trace, state_of(options));
}

}  // namespace

LinkState state_of(const LinkModelOptions& options) {
  LinkState state = state_of(options.profile);
  if (options.bytes_per_s > 0.0) state.bytes_per_s = options.bytes_per_s;
  if (options.delay_s > 0.0) state.delay_s = options.delay_s;
  if (options.jitter_s > 0.0) state.jitter_s = options.jitter_s;
  if (options.loss > 0.0) state.loss = options.loss;
  return state;
}

LinkTrace read_link_trace(const std::filesystem::path& path, const LinkState& otherwise) {
  std::istringstream lines(read_file(path, std::uint64_t{1} << 26));
  LinkTrace trace;
  std::string line;
  for (int number = 1; std::getline(lines, line); ++number) {
    if (line.empty() || line.front() == '#') continue;
    const auto fail = [&](const std::string& what) {
      throw Error(ErrorCode::kBadInput, what, {path.string() + ":" + std::to_string(number)},
                  "write seconds,bytes_per_s[,delay_s[,jitter_s[,loss]]], seconds from 0 on and rising");
    };
    std::vector<double> values;
    std::istringstream fields(line);
    for (std::string field; std::getline(fields, field, ',');) {
      char* end = nullptr;
      values.push_back(std::strtod(field.c_str(), &end));
      while (*end == ' ' || *end == '\r') ++end;
      if (end == field.c_str() || *end != '\0' || !std::isfinite(values.back()) || values.back() < 0.0)
        fail("'" + field + "' is no number that is zero or more");
    }
    if (values.size() < 2 || values.size() > 5) fail("a line has two to five numbers");
    if (trace.from_s.empty() ? values[0] != 0.0 : values[0] <= trace.from_s.back()) fail("times do not rise from 0");
    if (values.size() > 4 && values[4] > 0.9) fail("of packets, at most 0.9 are lost");
    LinkState state = otherwise;
    state.bytes_per_s = values[1];
    if (values.size() > 2) state.delay_s = values[2];
    if (values.size() > 3) state.jitter_s = values[3];
    if (values.size() > 4) state.loss = values[4];
    trace.from_s.push_back(values[0]);
    trace.states.push_back(state);
  }
  if (trace.states.empty())
    throw Error(ErrorCode::kBadInput, "a link's trace says nothing", {path.string()}, "write at least one line");
  if (std::all_of(trace.states.begin(), trace.states.end() - (trace.states.size() > 1),
                  [](const LinkState& s) { return s.bytes_per_s == 0.0; }))
    throw Error(ErrorCode::kBadInput, "a link that never carries anything", {path.string()},
                "let some line carry more than 0 bytes per second");
  return trace;
}

LinkModel::LinkModel(LinkTrace trace, std::uint64_t seed) : trace_(std::move(trace)), seed_(seed) {
  MAPWEAVE_EXPECT(!trace_.states.empty() && trace_.states.size() == trace_.from_s.size(), "a link is somehow");
}

LinkModel::LinkModel(const LinkModelOptions& options, std::uint64_t seed) : LinkModel(trace_of(options), seed) {}

LinkModel::Span LinkModel::span_at(double at_s) const {
  if (trace_.states.size() == 1) return {trace_.states.front(), std::numeric_limits<double>::infinity()};
  const double period_s = trace_.from_s.back(), round_s = std::floor(at_s / period_s) * period_s;
  auto next = std::upper_bound(trace_.from_s.begin(), trace_.from_s.end(), at_s - round_s);
  next = std::min(next, trace_.from_s.end() - 1);  // rounding
  return {trace_.states[static_cast<std::size_t>(next - trace_.from_s.begin()) - 1], round_s + *next};
}

double LinkModel::left(double at_s, double bytes) const {
  for (;;) {
    const auto [state, until_s] = span_at(at_s);
    const bool is_still = trace_.states.size() > 1 && state.bytes_per_s == 0.0;
    if (state.bytes_per_s == 0.0 && !is_still) return at_s;
    const double end_s = is_still ? until_s : at_s + bytes / state.bytes_per_s;
    if (end_s <= until_s && !is_still) return end_s;
    bytes -= (until_s - at_s) * state.bytes_per_s;
    at_s = std::max(until_s, std::nextafter(at_s, std::numeric_limits<double>::infinity()));
  }
}

double LinkModel::uniform() {
  return static_cast<double>(mixed(seed_ ^ mixed(++drawn_ * 0x9e3779b97f4a7c15u)) >> 11) * 0x1p-53;
}

double LinkModel::send(double at_s, std::size_t bytes) {
  MAPWEAVE_EXPECT(at_s >= 0.0, "virtual time begins at 0");
  double now_s = std::max(at_s, free_s_);
  auto fresh = static_cast<std::size_t>(std::ceil(std::max(1.0, static_cast<double>(bytes)) / kPacketBytes));
  double last_bytes = static_cast<double>(bytes) - kPacketBytes * static_cast<double>(fresh - 1);
  using Again = std::pair<double, double>;  // when it is known to be lost; bytes
  std::priority_queue<Again, std::vector<Again>, std::greater<>> lost;
  while (fresh > 0 || !lost.empty()) {
    double size = kPacketBytes;
    if (!lost.empty() && (fresh == 0 || lost.top().first <= now_s)) {
      now_s = std::max(now_s, lost.top().first);
      size = lost.top().second;
      lost.pop();
    } else if (--fresh == 0) {
      size = last_bytes;
    }
    now_s = left(now_s, size);
    const LinkState& state = span_at(now_s).state;
    // Jitter is never early: the absolute value of a normal number, by Box and Muller.
    double delay_s = state.delay_s;
    if (state.jitter_s > 0.0) {
      const double radius = std::sqrt(-2.0 * std::log(1.0 - uniform())), turn = 2.0 * M_PI * uniform();
      delay_s += state.jitter_s * std::abs(radius * std::cos(turn));
    }
    if (state.loss > 0.0 && uniform() < state.loss)
      lost.emplace(now_s + std::max(kLeastRetry_s, 2.0 * state.delay_s + 4.0 * state.jitter_s), size);
    else
      arrived_s_ = std::max(arrived_s_, now_s + delay_s);
  }
  free_s_ = now_s;
  return arrived_s_;
}

}  // namespace mapweave::transport
