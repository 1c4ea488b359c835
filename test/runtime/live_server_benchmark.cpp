// What the live camera map server costs, as JSON. Robots with depth cameras in one apartment, 10 frames/s; the cameras
// hand over features.
//   live_server_benchmark record FILE [CLIENTS [SECONDS]]   what each publishes alone, with its times
//   live_server_benchmark replay FILE CLIENTS,CLIENTS...    so many of them at sensor speed: what the server costs
//   live_server_benchmark lockstep FILE CLIENTS,CLIENTS...  the same without threads or waiting: what merging costs
//   live_server_benchmark team [CLIENTS [SECONDS]]          whole clients in real time: dropped frames
#include <mapweave/core/error.h>
#include <mapweave/runtime/live_map_server.h>
#include <mapweave/runtime/metrics.h>
#include <mapweave/simulation/feature_sensor.h>
#include <mapweave/tiers/subjects.h>
#include <support/live_camera.h>
#include <support/live_channel.h>
#include <support/seen_frame.h>

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include <unistd.h>

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <deque>
#include <fstream>
#include <map>
#include <sstream>
#include <thread>

using namespace mapweave;
namespace subject = tiers::subject;
using runtime::LiveMapServer;
using Clock = std::chrono::steady_clock;

namespace {

constexpr double kFramesPerSecond = 10.0, kShareRate_hz = 2.0, kMetresPerSecond = 0.65;

class Building {
 public:
  Building(std::size_t robots, double seconds, WorkerPool& pool)
      : options_(options(robots, seconds)), world_(options_, pool) {
    field_.emplace(world_.scene(0), world_.buildings()[0], features_);
    for (std::size_t i = 0; i < robots; ++i) recordings_.emplace_back(world_, *field_, features_, i, 0);
  }
  visual::ClientPlace place(std::size_t robot) const {
    return {{RobotId(options_.robots[robot].id), SensorId("camera")},
            compose(inverse(world_.world_from_robot(robot, 0.0)), recordings_[robot].frame(0).world_from_camera)};
  }
  Pinhole camera() const {
    const auto& model = options_.cameras[0].intrinsics();
    return {model.width, model.height, model.fx, model.fy, model.cx, model.cy};
  }
  std::vector<visual::FeatureFrame> frames(std::size_t robot, double seconds) const {
    const auto count = std::min(recordings_[robot].frame_count(), static_cast<std::size_t>(seconds * kFramesPerSecond));
    std::vector<visual::FeatureFrame> frames;
    for (std::size_t i = 0; i < count; ++i) frames.push_back(test::frame_of(recordings_[robot].frame(i)));
    return frames;
  }

 private:
  static simulation::WorldOptions options(std::size_t robots, double seconds) {
    simulation::WorldOptions options;
    options.seed = 7;
    options.buildings.resize(1);
    options.buildings[0].kind = simulation::PlanKind::apartment;
    options.buildings[0].seed = 7;
    options.cameras.resize(1);
    options.cameras[0].kind = simulation::SimulatedCameraKind::rgbd;
    options.cameras[0].frames_per_second = kFramesPerSecond;
    options.robots.resize(robots);
    for (std::size_t i = 0; i < robots; ++i) {
      auto& robot = options.robots[i];
      robot.id = "robot-" + std::to_string(100 + i);
      robot.first_room = static_cast<int>(i % 4);
      robot.last_room = robot.first_room + 3;
      robot.order = i % 8 < 4 ? simulation::TourOrder::along : simulation::TourOrder::back;
      robot.length_m = kMetresPerSecond * seconds;
    }
    return options;
  }

  simulation::WorldOptions options_;
  simulation::FeatureOptions features_;
  simulation::World world_;
  std::optional<simulation::LandmarkField> field_;
  std::vector<simulation::FeatureRecording> recordings_;
};

struct RecordedMessage {
  double after_s = 0.0;
  std::uint32_t client = 0;
  transport::Envelope message;
};

// What a client publishes that nobody answers but with receipts.
std::vector<RecordedMessage> messages_of(const Building& building, std::uint32_t client, double seconds) {
  std::vector<RecordedMessage> messages;
  const visual::ClientPlace place = building.place(client);
  visual::VisualClient camera(building.camera(), 0.0, {}, matching::shipped_vocabulary());
  tiers::CameraAgent agent(place);
  bool greeted = false;
  const double offset_s = static_cast<double>(client * 37 % 50) / 100.0;
  const auto frames = building.frames(client, seconds);
  for (std::size_t i = 0; i < frames.size(); ++i) {
    camera.add(frames[i]);
    const double after_s = offset_s + static_cast<double>(i + 1) / kFramesPerSecond;
    const auto record_message = [&](const char* what, std::string bytes) {
      messages.push_back({after_s, client, {what, std::move(bytes)}});
    };
    if ((i + 1) % static_cast<std::size_t>(kFramesPerSecond / kShareRate_hz) != 0 || !camera.run(place)) continue;
    if (!std::exchange(greeted, true))
      record_message(subject::kHello, encode(Hello{*camera.run(place), matching::shipped_vocabulary().hash()}));
    for (transport::Envelope& update : agent.updates(camera, frames[i].stamp)) {
      const MapUpdate decoded = decode_map_update(update.bytes, "a client");
      agent.stored({decoded.origin, decoded.sequence, 0});
      messages.push_back({after_s, client, std::move(update)});
    }
    if (auto view = agent.view(camera))
      record_message(subject::kView, std::move(*view));
    else if (auto request = agent.place_request(camera))
      record_message(subject::kPlaceRequest, std::move(*request));
  }
  return messages;
}

void record(const std::string& path, std::size_t clients, double seconds) {
  WorkerPool pool(available_processors());
  const Building building(clients, seconds, pool);
  std::vector<RecordedMessage> all;
  for (auto& messages :
       pool.map(clients, [&](std::size_t i) { return messages_of(building, static_cast<std::uint32_t>(i), seconds); }))
    std::move(messages.begin(), messages.end(), std::back_inserter(all));
  std::stable_sort(all.begin(), all.end(),
                   [](const RecordedMessage& a, const RecordedMessage& b) { return a.after_s < b.after_s; });
  std::ofstream file(path, std::ios::binary);
  for (const RecordedMessage& one : all) {
    file << one.after_s << ' ' << one.client << ' ' << one.message.subject << ' ' << one.message.bytes.size() << '\n';
    file.write(one.message.bytes.data(), static_cast<std::streamsize>(one.message.bytes.size()));
  }
  std::printf("%zu messages of %zu clients\n", all.size(), clients);
}

std::vector<RecordedMessage> read(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::vector<RecordedMessage> all;
  std::size_t bytes = 0;
  for (RecordedMessage one; file >> one.after_s >> one.client >> one.message.subject >> bytes && file.get() == '\n';) {
    one.message.bytes.resize(bytes);
    file.read(one.message.bytes.data(), static_cast<std::streamsize>(bytes));
    all.push_back(one);
  }
  if (all.empty()) throw Error(ErrorCode::kMissing, "no messages there", path, "record some first");
  return all;
}

double process_cpu_seconds() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

tiers::ServerOptions sharing(tiers::Sharing share) {
  tiers::ServerOptions options;
  options.share = share;
  options.share_rate_hz = kShareRate_hz;
  return options;
}

struct Journal {
  std::filesystem::path path =
      std::filesystem::temp_directory_path() / ("live_server_benchmark." + std::to_string(getpid()) + ".mwj");
  ~Journal() {
    for (const char* end : {"", "-wal", "-shm"}) std::filesystem::remove(path.string() + end);
  }
};

nlohmann::ordered_json costs(const runtime::ServerCounts& counts, std::size_t clients, double seconds) {
  runtime::ClientCounts sum;
  for (const runtime::ClientCounts& client : counts.clients) runtime::add(sum, client);
  const auto each_ms = [](double s, std::uint64_t count) {
    return count == 0 ? 0.0 : 1e3 * s / static_cast<double>(count);
  };
  const double minutes = static_cast<double>(clients) * seconds / 60.0;
  return {{"update_ms", each_ms(sum.update_s, sum.updates)},
          {"retrieval_ms", each_ms(sum.retrieval_s, sum.views)},
          {"sending_ms", each_ms(sum.sending_s, sum.shares)},
          {"place_ms", each_ms(sum.place_s, sum.places)},
          {"updates", sum.updates},
          {"views", sum.views},
          {"shares", sum.shares},
          {"places", sum.places},
          {"refused", sum.refused},
          {"mean_wait_ms", each_ms(sum.waited_s, sum.updates)},
          {"longest_wait_ms", 1e3 * sum.longest_wait_s},
          {"longest_place_ms", 1e3 * sum.longest_place_s},
          {"longest_hold_ms", 1e3 * counts.longest_hold_s},
          {"heard_kB_per_client_s", 1e-3 * static_cast<double>(sum.received_bytes) / (60.0 * minutes)},
          {"sent_kB_per_client_s", 1e-3 * static_cast<double>(sum.sent_bytes) / (60.0 * minutes)},
          {"handling_s_per_client_minute", (sum.update_s + sum.retrieval_s + sum.sending_s + sum.place_s) / minutes},
          {"saving_s_per_client_minute", counts.saving_s / minutes},
          {"merging_s_per_client_minute", counts.merging_s / minutes},
          {"merges", counts.merges},
          {"longest_merge_s", counts.longest_merge_s},
          {"trouble", counts.trouble}};
}

// Merged what was published, too: that is part of what clients cost.
bool has_done_all(const runtime::ServerCounts& counts, std::uint64_t updates) {
  runtime::ClientCounts sum;
  for (const runtime::ClientCounts& client : counts.clients) runtime::add(sum, client);
  return sum.updates == updates && !counts.is_merging;
}

nlohmann::ordered_json replay(const std::vector<RecordedMessage>& all, std::size_t clients) {
  const Journal journal;
  const double before_s = process_cpu_seconds(), mine_before_s = runtime::thread_cpu_seconds();
  LiveMapServer server(TierId("edge"), sharing(tiers::Sharing::view), {}, {}, journal.path);
  std::vector<std::shared_ptr<transport::Channel>> links;
  for (std::size_t i = 0; i < clients; ++i) links.push_back(server.connect());
  const Clock::time_point begin = Clock::now();
  double seconds = 0.0;
  std::uint64_t messages = 0, put_off = 0;  // messages: updates
  for (const RecordedMessage& one : all) {
    if (one.client >= clients) continue;
    std::this_thread::sleep_until(begin + std::chrono::duration<double>(one.after_s));
    test::take(*links[one.client], std::chrono::milliseconds(0));
    const auto sent = links[one.client]->send(one.message);
    put_off += sent == transport::Channel::Sent::later;
    messages += sent == transport::Channel::Sent::taken && one.message.subject == subject::kUpdate;
    seconds = one.after_s;
  }
  while (!has_done_all(server.counts(), messages)) std::this_thread::sleep_for(std::chrono::milliseconds(10));
  const double cpu_s = process_cpu_seconds() - before_s - (runtime::thread_cpu_seconds() - mine_before_s);
  const double minutes = static_cast<double>(clients) * seconds / 60.0;
  nlohmann::ordered_json row{{"clients", clients},
                             {"seconds", seconds},
                             {"cpu_s_per_client_minute", cpu_s / minutes},
                             {"cores", cpu_s / seconds}};
  row.update(costs(server.counts(), clients, seconds));
  row["put_off"] = put_off;
  const fusion::FusionResult& joined = server.finish().merged();
  row["components"] = joined.components.size();
  for (const fusion::StageTime& stage : joined.stages) row["last_merge_s"][stage.name] = stage.seconds;
  return row;
}

nlohmann::ordered_json lockstep(const std::vector<RecordedMessage>& all, std::size_t clients) {
  WorkerPool pool(1);
  tiers::ServerOptions options = sharing(tiers::Sharing::view);
  options.wait = false;
  tiers::VisualServer server(TierId("edge"), options, {});
  std::map<std::string, double> stages_s;
  std::vector<std::optional<SessionId>> sessions(clients);
  double merging_s = 0.0, longest_s = 0.0, retrieval_s = 0.0, seconds = 0.0;
  int merges = 0, views = 0;
  for (const RecordedMessage& one : all) {
    if (one.client >= clients) continue;
    auto& session = sessions[one.client];
    if (one.message.subject == subject::kHello) {
      const Hello hello = decode_hello(one.message.bytes, "a client");
      session = hello.session;
      server.greet(hello);
    } else if (one.message.subject == subject::kUpdate) {
      server.receive(*session, one.message.bytes);
    } else if (one.message.subject == subject::kView) {
      const ClientView view = decode_client_view(one.message.bytes, "a client");
      const double before_s = runtime::thread_cpu_seconds();
      server.share(*session, view);
      retrieval_s += runtime::thread_cpu_seconds() - before_s;
      ++views;
    }
    const Stamp now{static_cast<std::int64_t>(1e9 * one.after_s)};
    server.advance(now, pool);
    seconds = one.after_s;
    if (const auto work = server.pending(); work && !work->is_done()) {
      const double before_s = runtime::thread_cpu_seconds();
      work->run();
      const double spent_s = runtime::thread_cpu_seconds() - before_s;
      ++merges;
      merging_s += spent_s;
      longest_s = std::max(longest_s, spent_s);
      server.advance(now, pool, false);
      for (const fusion::StageTime& stage : server.merged().stages) stages_s[stage.name] += stage.seconds;
    }
  }
  const double minutes = static_cast<double>(clients) * seconds / 60.0;
  nlohmann::ordered_json row{{"clients", clients},
                             {"merges", merges},
                             {"merging_s_per_client_minute", merging_s / minutes},
                             {"longest_merge_s", longest_s},
                             {"retrieval_ms", 1e3 * retrieval_s / std::max(1, views)}};
  const auto& joined = server.merged();
  row["components"] = joined.components.size();
  if (!joined.components.empty()) {
    row["keyframes"] = joined.components.front().map.nodes.size();
    row["members"] = joined.components.front().members.size();
  }
  for (const auto& [stage, spent_s] : stages_s) row["stages_s_per_client_minute"][stage] = spent_s / minutes;
  for (const fusion::StageTime& stage : joined.stages) row["last_merge_s"][stage.name] = stage.seconds;
  const auto sealed = server.seal(pool, *make_silent_progress());
  std::vector<Eigen::Vector3d> live, at_the_end;
  if (!joined.components.empty() && !sealed.components.empty())
    for (const auto& [id, node] : joined.components.front().map.nodes)
      if (const Node* other = sealed.components.front().map.nodes.find(id)) {
        live.push_back(node.map_from_node.t);
        at_the_end.push_back(other->map_from_node.t);
      }
  double square = 0.0, most_m = 0.0;
  if (live.size() > 2) {
    const auto columns = [](const std::vector<Eigen::Vector3d>& points) {
      return Eigen::Map<const Eigen::Matrix3Xd>(points.front().data(), 3, static_cast<Eigen::Index>(points.size()));
    };
    const Eigen::Matrix4d aligned = Eigen::umeyama(columns(live), columns(at_the_end), false);
    for (std::size_t i = 0; i < live.size(); ++i) {
      const double apart_m = ((aligned * live[i].homogeneous()).head<3>() - at_the_end[i]).norm();
      square += apart_m * apart_m;
      most_m = std::max(most_m, apart_m);
    }
  }
  row["sealed_components"] = sealed.components.size();
  row["from_seal_m"] = live.empty() ? 0.0 : std::sqrt(square / static_cast<double>(live.size()));
  row["most_from_seal_m"] = most_m;
  return row;
}

nlohmann::ordered_json team(std::size_t clients, double seconds) {
  WorkerPool pool(available_processors());
  const Building building(clients, seconds, pool);
  const auto frames = pool.map(clients, [&](std::size_t i) { return building.frames(i, seconds); });
  const Journal journal;
  const double before_s = process_cpu_seconds();
  LiveMapServer server(TierId("edge"), sharing(tiers::Sharing::full), {}, {}, journal.path);
  std::deque<test::LiveCamera> cameras;
  for (std::size_t i = 0; i < clients; ++i)
    cameras.emplace_back(building.place(i), building.camera(), 0.0, test::LiveCameraOptions{}, server.connect());
  const Clock::time_point begin = Clock::now();
  std::size_t count = 0;
  for (std::size_t frame = 0; frame < static_cast<std::size_t>(seconds * kFramesPerSecond); ++frame)
    for (std::size_t i = 0; i < clients; ++i) {
      if (frame >= frames[i].size()) continue;
      std::this_thread::sleep_until(
          begin +
          std::chrono::duration<double>(
              (static_cast<double>(frame) + static_cast<double>(i) / static_cast<double>(clients)) / kFramesPerSecond));
      cameras[i].add(frames[i][frame]);
      ++count;
    }
  const double lasted_s = std::chrono::duration<double>(Clock::now() - begin).count();
  const double cpu_s = process_cpu_seconds() - before_s;
  nlohmann::ordered_json row{
      {"clients", clients}, {"seconds", lasted_s}, {"frames", count}, {"cores", cpu_s / lasted_s}};
  row.update(costs(server.counts(), clients, lasted_s));
  int dropped = 0;
  std::size_t borrowed = 0;
  for (auto& camera : cameras) {
    borrowed += camera.finish(std::chrono::seconds(10)).borrowed_seen();
    dropped += camera.dropped();
  }
  row["dropped"] = dropped;
  row["borrowed_seen"] = borrowed;
  const fusion::FusionResult& joined = server.finish().merged();
  row["components"] = joined.components.size();
  for (const fusion::StageTime& stage : joined.stages) row["last_merge_s"][stage.name] = stage.seconds;
  return row;
}

}  // namespace

int main(int argc, char** argv) try {
  const std::string what = argc > 1 ? argv[1] : "";
  const auto number = [&](int i, double otherwise) { return argc > i ? std::atof(argv[i]) : otherwise; };
  if (what == "record" && argc > 2) {
    record(argv[2], static_cast<std::size_t>(number(3, 16)), number(4, 60));
  } else if ((what == "replay" || what == "lockstep") && argc > 3) {
    const std::vector<RecordedMessage> all = read(argv[2]);
    auto rows = nlohmann::ordered_json::array();
    std::istringstream counts(argv[3]);
    for (std::string count; std::getline(counts, count, ',');) {
      rows.push_back((what == "replay" ? replay : lockstep)(all, static_cast<std::size_t>(std::atoi(count.c_str()))));
      std::fprintf(stderr, "%s\n", rows.back().dump().c_str());
    }
    std::printf("%s\n", rows.dump(2).c_str());
  } else if (what == "team") {
    std::printf("%s\n", team(static_cast<std::size_t>(number(2, 8)), number(3, 60)).dump(2).c_str());
  } else {
    std::fprintf(stderr,
                 "live_server_benchmark record FILE [CLIENTS [SECONDS]] | replay|lockstep FILE CLIENTS,... | team "
                 "[CLIENTS [SECONDS]]\n");
    return 2;
  }
  return 0;
} catch (const std::exception& error) {
  std::fprintf(stderr, "%s\n", error.what());
  return 1;
}
