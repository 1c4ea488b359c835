#pragma once
// The engines `rbpf` and `icp`: MRPT's, each robot's in a child process of its own (the helper mrpt_mapper), because
// they keep process-wide state. A helper that ends early ends its robot only.

#include <mapweave/laser/laser_mapper.h>
#include <mapweave/laser/mapper_protocol.h>
#include <mapweave/laser/submap_cutter.h>

#include <string>
#include <variant>
#include <vector>

namespace mapweave::laser {

struct ExternalMapperOptions {
  std::string helper;
  bool show_messages = false;
  SubmapCutterOptions submaps;

  template <class Visitor>
  void describe(Visitor& v) {
    v.text("helper", helper, "path of the helper program mrpt_mapper; empty: beside the running program");
    v.flag("show_messages", show_messages, "pass the many messages of MRPT's own code through to standard error");
    v.section("submaps", submaps, "how the trajectory of rbpf or icp is cut into submaps");
  }
};

// The helper works while the caller goes on: add() waits only when it is hundreds of scans behind. Before finish() the
// map is that of the last catch_up(). Errors: kMissing where there is no helper, kHelperFailed where it ended early
// ("alpha: helper mrpt_mapper ended by signal 9 after 57 scans; ..."). After one, every call throws the same again. The
// destructor ends the helper; when this process dies, however, the helper leaves by itself. Memory: here what was added
// (a packed scan each) until finish(); the helper's is bounded by its options' memory_limit_mb.
class ExternalMapper : public LaserMapper {
 public:
  // The session's run is the stamp of the first input, the map is named after the robot.
  ExternalMapper(ClientId client, std::variant<RbpfOptions, IcpOptions> engine, ExternalMapperOptions options = {});
  ~ExternalMapper() override;
  ExternalMapper(const ExternalMapper&) = delete;
  ExternalMapper& operator=(const ExternalMapper&) = delete;

  void add(const LaserInput&) override;
  void finish() override;
  void catch_up() override;  // waits for the helper; costs as finish() does
  Map snapshot() const override { return map_; }
  double helper_cpu_seconds() const override { return helper_cpu_seconds_; }

  int helper_process() const { return process_; }  // its id; -1 once it has ended

 private:
  struct SentScan {
    Stamp stamp;
    PackedScan scan;
  };
  void start(const std::string& program);
  void send(std::string_view bytes);                     // and takes what comes meanwhile
  bool exchange(std::string_view& outgoing, bool wait);  // one round; false: the helper has closed its side
  void send(const Stamp& stamp, decltype(Sensed::body) sensed);
  void take(const MapperOutput&);
  void await_poses();
  Map map_of(std::vector<SentScan> scans) const;  // of the first scans, which have poses
  int reap(int* status, int options);             // as waitpid(2); counts the processor time
  [[noreturn]] void fail();                       // the helper ended early: reaps it and says how
  void end_helper();

  ClientId client_;
  ExternalMapperOptions options_;
  std::optional<Stamp> first_stamp_;
  int process_ = -1, stream_ = -1;
  std::uint64_t sent_ = 0;  // messages of what was sensed
  std::vector<SentScan> scans_;
  protocol::FrameParser incoming_;
  std::vector<ScanPose> poses_;
  std::uint64_t finished_scans_ = 0;
  bool is_done_ = true;  // all poses that were asked for are there
  std::string failure_;  // what the helper said of its own end
  std::optional<Error> error_;
  bool finished_ = false;
  double helper_cpu_seconds_ = 0.0;
  Map map_;
};

}  // namespace mapweave::laser
