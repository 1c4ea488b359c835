#pragma once
// A robot of a deployment: plays its recording, packs what a laser mapper needs, and sends it to its edge, whatever
// becomes of the wire meanwhile. A robot that maps on board (with cameras, also beside a laser; a laser in mode
// onboard) sends its maps at its end.

#include <mapweave/core/error.h>
#include <mapweave/runtime/live_options.h>
#include <mapweave/runtime/live_plan.h>
#include <mapweave/runtime/run_configuration.h>
#include <mapweave/transport/channel.h>

#include <chrono>
#include <functional>
#include <memory>
#include <optional>
#include <string>

namespace mapweave::runtime {

// A new channel to the other end; null, or one that is closed: it is not there now, and is asked for again. Called on
// any thread.
using Connect = std::function<std::shared_ptr<transport::Channel>()>;
using ConnectToEdge = std::function<std::shared_ptr<transport::Channel>(const TierId& edge)>;
// To the edge's camera map server, for one of the robot's cameras that share: numbered from 0 as they begin.
using ConnectCamera = std::function<std::shared_ptr<transport::Channel>(const TierId& edge, int number)>;
inline constexpr std::size_t kMostSharingCameras = 8;  // most sharing cameras of one robot

struct LiveRobotCounts {
  std::uint64_t records = 0, scans = 0, lost_scans = 0;  // records read; scans packed; scans without room. On
                                                         // board, records and scans count what was mapped
  std::uint64_t messages = 0, confirmed = 0;             // messages sent; messages that the edge has stored
  std::size_t waiting_bytes = 0;                         // bytes of messages that the edge has not stored
  std::uint64_t sent_bytes = 0;                          // bytes sent, with repetitions
  double recorded_s = 0.0;                               // length of the data read so far
  bool is_on_board = false;                              // the robot maps itself
  bool is_read = false;                                  // the recording has ended
  bool is_edge_on_wire = false;
  double silent_s = 0.0;              // time since the edge's last message
  std::string refusal;                // the edge's last refusal
  std::optional<Error> trouble;       // why its log was not read to its end; set once reading ends
  TierId edge;                        // its edge now; empty: the coordinator named none, or none has room
  std::uint64_t moves = 0;            // how often it was given to another edge
  std::optional<double> bytes_per_s;  // what the link to its edge carried when last measured
  transport::Channel::Health wire{};  // state of the link to its edge
  bool is_released = true;            // nobody needs its data any more once its edge has stored all
  // Counts of cameras that share while they drive, so far.
  struct Sharing {
    std::size_t cameras = 0, on_wire = 0;              // cameras that began; that the camera map server answers
    std::uint64_t sent_bytes = 0, received_bytes = 0;  // bytes of all cameras, with repetitions
    std::uint64_t shared_keyframes = 0, borrowed = 0;  // most keyframes of others kept; most landmarks seen at once
    std::string refusal;                               // the camera map server's last refusal
  };
  std::optional<Sharing> sharing;  // set where cameras share
};

// Two threads of its own: one reads, one speaks. All calls are thread-safe. One recording is one run: a robot that
// begins again goes on where its edge has stored what it said.
class LiveRobot {
 public:
  // The plan's sensors are chosen; what is wrong with its log is said to the edge at its end. Throws Error(kBadInput)
  // for a robot without a sensor. to_camera_map_server: where cameras share (server.share); null: they do not.
  LiveRobot(const PlannedRobot& robot, const RunConfiguration& configuration, const LiveOptions& options,
            ConnectToEdge to_edge, ConnectCamera to_camera_map_server = nullptr);
  ~LiveRobot();

  // The recording ends where it is.
  void end();
  // Nothing more is said, its end neither: another one goes on with the recording. Its log may end from then on.
  void leave();
  // Goes to the edge that the plan names for it, if that is another one: ends the wire to the one before, and says to
  // the new one, from the beginning of its recording, what that does not have. An older plan than before is passed
  // over.
  void follow(const LivePlan& plan);
  void use(const LiveOptions& options);  // as LiveEdge::use()
  // All is said, and stored at the edge; with a coordinator, the team's map is written, too: until then the robot may
  // be given to another edge.
  bool is_done() const;
  bool wait(std::chrono::milliseconds patience) const;  // for is_done()
  LiveRobotCounts counts() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// What all programs of a deployment must have alike for one map: of the configuration all but where robots' logs lie,
// what is written, and how programs talk; and the program's version.
Hash agreement_of(RunConfiguration configuration);

// Whether cameras of robots share with an edge's camera map server while they drive.
inline bool shares_cameras(const RunConfiguration& configuration) {
  return configuration.server.share != tiers::Sharing::none;
}

// Throws Error(kBadInput), naming the key, for what robots, edges and a cloud that run as programs of their own do not
// do yet: cameras of several edges that share while they drive, or with a coordinator; a coordinator of edges with
// brokers of their own; parts of logs. The plan's sensors need not be chosen.
void expect_live(const RunConfiguration& configuration, const RunPlan& plan);

}  // namespace mapweave::runtime
