#pragma once
// What a run and a worker say to each other: a head as JSON, and what is long behind it, cut into parts.

#include <mapweave/core/error.h>
#include <mapweave/core/hash.h>
#include <mapweave/runtime/run_configuration.h>
#include <mapweave/transport/channel.h>

#include <nlohmann/json.hpp>

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace mapweave::runtime {

// Subjects. Of the run: task. Of the worker: alive, every second while it works; mapped, a message of the robot that it
// mapped; answer, of another task; failed, an Error that is not the robot's. Of both: part, of the task or the answer
// before it.
namespace cluster_subject {
inline constexpr char kTask[] = "task", kAlive[] = "alive", kMapped[] = "mapped", kAnswer[] = "answer",
                      kFailed[] = "failed", kPart[] = "part";
}

// A folder that is gone with this. what: for people, of what it shall hold.
class PassingFolder {
 public:
  explicit PassingFolder(const std::string& what);
  ~PassingFolder();
  PassingFolder(const PassingFolder&) = delete;
  PassingFolder& operator=(const PassingFolder&) = delete;
  const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

struct ClusterMessage {
  nlohmann::json head;             // an object
  std::vector<std::string> blobs;  // in order
};
// The head under `subject`, then the parts.
std::vector<transport::Envelope> envelopes_of(const char* subject, const ClusterMessage& message);

// Puts one message after another together. Not thread-safe.
class ClusterReader {
 public:
  // The message that ends with this envelope: a head or a part. Throws Error kCorrupt or kBadInput for what is not
  // sound, or too long.
  std::optional<ClusterMessage> add(const transport::Envelope& envelope, const std::string& where);

 private:
  nlohmann::json head_;
  std::vector<std::size_t> sizes_;
  std::string bytes_;
};

enum class ClusterTaskKind { robot, judging, dense_map };

struct ClusterTask {
  // Whose log the task takes.
  struct Robot {
    RobotId id;
    std::string log;  // where the run has it
    Hash log_sha256;
    std::string configuration;  // YAML: of this robot alone
  };
  std::string version;  // of the program that asks
  ClusterTaskKind kind = ClusterTaskKind::robot;
  std::string name;           // for people: "robot alpha", "the dense map of team"
  std::string configuration;  // YAML: of what no robot has
  std::vector<Robot> robots;
  std::vector<std::string> blobs;  // what is judged, or drawn
};

std::vector<transport::Envelope> envelopes_of(const ClusterTask& task);
// Throws Error kCorrupt or kBadInput for what is not sound.
ClusterTask decode_cluster_task(ClusterMessage message, const std::string& where);

// The configuration of a run without what its robots, edges and the cloud are to each other.
RunConfiguration configuration_of_task(RunConfiguration configuration);
ClusterTask task_of(const RunConfiguration& configuration, const PlannedRobot& robot);
// Throws Error for a text that is none. log: of its one robot; empty: it has none.
struct WorkerPlan {
  RunConfiguration configuration;
  Origins origins;
};
WorkerPlan configuration_in(const std::string& yaml, const std::filesystem::path& log = {});
// As the worker maps it, with its log at this path: one robot, its sensors chosen.
struct RobotPlan {
  RunConfiguration configuration;
  RunPlan plan;
};
RobotPlan plan_of(const ClusterTask& task, const std::filesystem::path& log);

}  // namespace mapweave::runtime
