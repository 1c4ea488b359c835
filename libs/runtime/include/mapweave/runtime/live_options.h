#pragma once
// How programs of a deployment talk and when they show something: the section `live` of a configuration.

#include <cstddef>
#include <string>

namespace mapweave::runtime {

inline constexpr std::size_t kMostLinks = 1000;  // of one program with its clients, at a time: bounds memory

struct LiveWireOptions {
  double repeat_s = 2.0;
  int window_kb = 4096;
  std::size_t window_bytes() const { return static_cast<std::size_t>(window_kb) << 10; }
  template <class Visitor>
  void describe(Visitor& v) {
    v.positive("repeat_s", repeat_s,
               "time in seconds without a receipt after which what was sent is sent again; larger values repeat less "
               "and recover later");
    v.integer("window_kb", window_kb, 64, 1 << 20,
              "most kB of messages that may be on their way without a receipt; larger values fill long wires better "
              "and take more memory");
  }
};

// Options of an edge's camera map server, with which cameras share while they drive.
struct LiveServerOptions {
  int handlers = 2;
  int merge_threads = 1;
  double merge_share = 0.5;
  int queue_kb = 4096;
  int answers_kb = 1024;
  int journal_kb = 65536;
  template <class Visitor>
  void describe(Visitor& v) {
    v.integer("handlers", handlers, 1, 64,
              "threads that handle what cameras say; larger values let more cameras speak at a time");
    v.integer("merge_threads", merge_threads, 1, 64,
              "threads that merge the cameras' maps, at a lower priority than the others; larger values merge faster");
    v.fraction("merge_share", merge_share,
               "largest share of the time in which maps are merged: after a merge the next one waits so long that "
               "merging takes no more; larger values merge more often");
    v.integer(
        "queue_kb", queue_kb, 64, 1 << 20,
        "most kB of one camera's messages that may wait at the camera map server to be handled; the camera keeps the "
        "rest and sends it later; larger values take more memory");
    v.integer("answers_kb", answers_kb, 64, 1 << 20,
              "most kB of answers that may wait until a camera takes them; at that many nothing more is shared with "
              "it; larger values fill slow wires more");
    v.integer(
        "journal_kb", journal_kb, 1, 1 << 30,
        "kB by which the journal of what cameras sent grows, and at least to twice its length, before it is written "
        "anew without what is outdated; larger values write it anew less often and take more of the disk");
  }
};

struct LiveOptions {
  static constexpr int kBrokerPort = 4222;
  std::string broker, keys, store = "mapweave-store";
  bool unprotected = false;
  double speed = 1.0;
  double preview_period_s = 5.0;
  int robot_buffer_kb = 262144;
  int edge_queue_kb = 32768;
  double patience_s = 15.0, lost_after_s = 30.0;
  std::string page_host = "127.0.0.1";
  int page_port = 0;
  LiveWireOptions wire;
  LiveServerOptions camera_map_server;
  bool is_over_ros() const { return broker == "ros"; }
  std::string broker_url() const { return broker.empty() ? "nats://127.0.0.1:" + std::to_string(kBrokerPort) : broker; }
  // Takes the options that may change while a program runs; the others stay.
  void take_while_running(const LiveOptions& news) {
    preview_period_s = news.preview_period_s;
    robot_buffer_kb = news.robot_buffer_kb;
    edge_queue_kb = news.edge_queue_kb;
    patience_s = news.patience_s;
    lost_after_s = news.lost_after_s;
    page_host = news.page_host;
    page_port = news.page_port;
  }
  std::size_t robot_buffer_bytes() const { return static_cast<std::size_t>(robot_buffer_kb) << 10; }
  std::size_t edge_queue_bytes() const { return static_cast<std::size_t>(edge_queue_kb) << 10; }
  template <class Visitor>
  void describe(Visitor& v) {
    v.text(
        "broker", broker,
        "NATS server with JetStream through which robots, edges and the cloud talk (serve): nats://host:port; empty: "
        "nats://127.0.0.1:4222, where the cloud starts one unless one answers there; ros: topics of ROS, for nodes "
        "(mapweave_ros)");
    v.text("keys", keys,
           "file that `mapweave serve keys` made for this program: its user, its password and the certificate by which "
           "it knows the broker (serve); empty: none, for a broker on this machine");
    v.flag("unprotected", unprotected,
           "talk to a broker on another machine without keys (serve): whoever reaches it can read all maps, and send "
           "others");
    v.text(
        "store", store,
        "folder in which edges and the cloud keep what they received until the results are written (serve), relative "
        "to where the program is started");
    v.non_negative("speed", speed,
                   "how fast a robot's recording is played, as a multiple of the speed at which it was recorded; "
                   "larger values are faster; 0: as fast as its edge takes it");
    v.positive("preview_period_s", preview_period_s,
               "time in seconds between two previews in which an edge and the cloud fuse the maps so far; larger "
               "values show less and cost less. The final map is the same");
    v.integer("robot_buffer_kb", robot_buffer_kb, 1, 1 << 30,
              "most kB of sensor data that a robot keeps while its edge does not take it; larger values survive longer "
              "outages. Beyond it scans are lost, and counted; odometry is kept");
    v.integer("edge_queue_kb", edge_queue_kb, 1, 1 << 30,
              "most kB of one robot's sensor data that may wait at its edge to be mapped; the rest waits at the robot; "
              "larger values take more memory");
    v.positive("patience_s", patience_s,
               "time in seconds without an answer after which a program reports who does not answer; the report is "
               "repeated after each further such time; larger values report later");
    v.positive(
        "lost_after_s", lost_after_s,
        "time in seconds after which an edge that says nothing is lost to the coordinator, which gives its robots "
        "to other edges; larger values let an edge start again before that");
    v.text("page_host", page_host,
           "address at which an edge, the cloud and a coordinator show their page (serve); another than 127.0.0.1 "
           "opens it to "
           "all who reach this machine: it is read-only, and asks for no password");
    v.integer("page_port", page_port, 0, 65535,
              "port of the page that shows what an edge, the cloud or a coordinator does while it runs (serve): one "
              "for each program "
              "of a machine; 0: no page");
    v.section("wire", wire, "messages between robots, edges and the cloud");
    v.section("camera_map_server", camera_map_server,
              "an edge's camera map server, with which cameras share while they drive (server.share)");
  }
};

}  // namespace mapweave::runtime
