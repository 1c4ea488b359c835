"""Launch files of the nodes of ROS 1, as they are installed: roslaunch finds them, what is killed goes on, and the end is the end."""
import gzip
import os
import pathlib
import pickle
import random
import re
import signal
import socket
import subprocess
import time
import unittest

import ros1_bags
import serve_test
import support

PYTHON = "/usr/bin/python3"   # what Debian's modules of ROS are for, whatever stands first in PATH
HERE = pathlib.Path(__file__).resolve().parent
BUILD = support.PROGRAM.parent.parent
KEEP_RUNNING = support.ROOT / "gui-less/launch/keep_running"
ROBOTS = {"alpha": 0.0, "beta": 0.8}


def missing():
    if not (BUILD / "bin/mapweave_ros").exists():
        return "this build has no nodes of ROS"
    done = subprocess.run([PYTHON, "-c", "import rospy, roslaunch, rosmaster, rosmsg, std_srvs.srv"], capture_output=True, text=True, check=False)
    return done.stderr.strip().splitlines()[-1] if done.returncode else ""


def free_port():
    """Below those that programs of ROS take for themselves meanwhile."""
    while True:
        with socket.socket() as listener:
            try:
                listener.bind(("127.0.0.1", random.randrange(20000, 30000)))
                return listener.getsockname()[1]
            except OSError:
                pass


def is_open(port):
    with socket.socket() as caller:
        return caller.connect_ex(("127.0.0.1", port)) == 0


def drives(scans):
    """What both robots publish, in the order of stamps."""
    messages = [message for robot, shift in ROBOTS.items() for message in ros1_bags.drive(scans, robot, shift)]
    return sorted(messages, key=lambda message: message[2])


class Program(support.Scenario):
    """Programs beside the test, whose words are in files."""

    def variables(self):
        return support.environment() | {"PWD": str(self.folder)}

    def begin(self, *command):
        log = self.folder / f"{pathlib.Path(str(command[0])).name}_{len(list(self.folder.glob('*.log')))}.log"
        with log.open("w") as said:
            process = subprocess.Popen([str(word) for word in command], cwd=self.folder, env=self.variables(), stdin=subprocess.DEVNULL, stdout=said,
                                       stderr=subprocess.STDOUT, start_new_session=True)
        process.log = log
        self.addCleanup(self.end, process)
        return process

    def end(self, process):
        if process.poll() is None:
            process.terminate()
            try:
                process.wait(40)
            except subprocess.TimeoutExpired:
                process.kill()
                process.wait()

    def await_(self, condition, what, seconds=60):
        end = time.monotonic() + seconds * support.PATIENCE
        while not condition():
            self.assertLess(time.monotonic(), end, "\n".join([what, *(f"--- {log.name}\n{log.read_text()[-3000:]}" for log in self.folder.glob("*.log"))]))
            time.sleep(0.05)

    def await_word(self, process, words, times=1):
        self.await_(lambda: process.log.read_text().count(words) >= times, words)

    def assert_ends(self, process, code, seconds=60):
        process.wait(seconds * support.PATIENCE)
        self.assertEqual(process.returncode, code, process.log.read_text())


class KeepRunning(Program):
    def keep(self, script, *options):
        return self.begin(PYTHON, KEEP_RUNNING, *options, "sh", "-c", script)

    def test_an_end_is_an_end(self):
        for code in (0, 2, 3, 4, 130):
            self.assert_ends(self.keep(f"echo begun; exit {code}"), code)
        for code in (0, 2, 3, 4, 130):
            self.assert_ends(self.keep(f"echo begun; exit {code}", "--service"), code)
        self.assertEqual([log.read_text() for log in self.folder.glob("*.log")], 10 * ["begun\n"])

    def test_what_was_killed_is_started_again(self):
        kept = self.keep("if [ -e killed ]; then echo again; else touch killed; kill -KILL $$; fi")
        self.assert_ends(kept, 0)
        self.assertRegex(kept.log.read_text(), "ended with signal 9; it is started again in 5 s\nagain\n$")

    def test_what_failed_is_started_again_as_a_service_until_it_is_stopped(self):
        kept = self.keep("if [ -e full ]; then echo away; exit 6; fi; touch full; exit 1", "--service")
        self.await_word(kept, "exit code 1")
        self.await_word(kept, "away", 2)
        self.await_word(kept, "exit code 6", 2)
        kept.send_signal(signal.SIGINT)
        self.assert_ends(kept, 130, 3)

    def test_what_has_left_its_results_is_done(self):
        kept = self.keep("echo begun; touch map; exit 6", "--service", "--until", "map")
        self.assert_ends(kept, 6)
        self.assertEqual(kept.log.read_text(), "begun\n")

    def test_an_interrupt_comes_once_and_is_a_pause_to_services(self):
        script = "trap 'echo INT; exit 0' INT; trap 'echo TERM; exit 130' TERM; echo begun; while :; do sleep 0.05; done"
        for options, word, code in (((), "INT", 0), (("--service",), "TERM", 130)):
            kept = self.keep(script, *options)
            self.await_word(kept, "begun")
            os.killpg(kept.pid, signal.SIGINT)   # as roslaunch does
            self.assert_ends(kept, code)
            self.assertEqual(kept.log.read_text(), f"begun\n{word}\n")

    def test_a_broker_ends_after_those_who_need_it(self):
        kept = self.keep("echo begun; sleep 100", "--service", "--linger", "2")
        self.await_word(kept, "begun")
        asked = time.monotonic()
        kept.send_signal(signal.SIGINT)
        self.assert_ends(kept, 128 + signal.SIGTERM)
        self.assertGreater(time.monotonic() - asked, 2.0)

    def test_nothing_runs_on_where_it_is_killed(self):
        kept = self.keep("echo pid $$; sleep 100 & wait")
        self.await_word(kept, "\n")
        kept.kill()
        kept.wait()
        process = pathlib.Path("/proc") / re.search(r"pid (\d+)", kept.log.read_text())[1]
        self.await_(lambda: not process.exists(), "it runs on", 10)


class Launch(Program):
    def setUp(self):
        why = missing() or ("" if serve_test.BROKER else "needs nats-server, of the Debian package nats-server")
        if why:
            self.skipTest(why)
        super().setUp()
        self.port, self.broker_port = free_port(), free_port()
        self.prefix = self.folder / "usr"
        done = subprocess.run(["cmake", "--install", BUILD, "--component", "ros", "--prefix", self.prefix], capture_output=True, text=True, check=False)
        self.assertEqual(done.returncode, 0, done.stderr)

    def variables(self):
        return super().variables() | {
            "ROS_MASTER_URI": f"http://127.0.0.1:{self.port}", "ROS_IP": "127.0.0.1", "ROS_HOME": str(self.folder / "ros_home"), "PYTHONUNBUFFERED": "1",
            "ROS_PACKAGE_PATH": f"{self.prefix}/share:/usr/share", "PYTHONPATH": str(self.prefix / "lib/python3/dist-packages")}

    def asked(self, *command, code=0, seconds=20):
        done = subprocess.run([str(word) for word in command], cwd=self.folder, env=self.variables(), capture_output=True, text=True,
                              timeout=seconds * support.PATIENCE, check=False)
        self.assertEqual(done.returncode, code, done.stdout + done.stderr)
        return done.stdout

    def launch(self, *words):
        return self.begin("roslaunch", "-p", self.port, "mapweave", *words)

    def play(self, messages, speed):
        (self.folder / "messages").write_bytes(pickle.dumps(messages))
        return self.begin(PYTHON, "-B", HERE / "ros_player.py", "messages", speed)

    def call(self, service):
        self.assertIn("success: True", self.asked("rosservice", "call", "--wait", service))

    def children_of(self, process):
        """{process: command line} of all that it started."""
        below, commands = {process.pid}, {}
        parents = dict(line.split()[::-1] for line in subprocess.run(["ps", "-eo", "ppid=,pid="], capture_output=True, text=True, check=True).stdout.splitlines())
        while more := {int(pid) for pid, parent in parents.items() if int(parent) in below} - below:
            below |= more
        for pid in below - {process.pid}:
            try:
                commands[pid] = (pathlib.Path("/proc") / str(pid) / "cmdline").read_text().split("\0")
            except (FileNotFoundError, ProcessLookupError):
                pass
        return commands

    def kill_node(self, launched, role):
        pids = [pid for pid, words in self.children_of(launched).items() if words[0].endswith("mapweave_ros") and words[1] == role]
        self.assertEqual(len(pids), 1)
        os.kill(pids[0], signal.SIGKILL)

    def test_packages_programs_and_services_are_found(self):
        find = "import roslib.packages, rospkg; print(rospkg.RosPack().get_path('mapweave'), *roslib.packages.find_node('mapweave', 'mapweave_ros'))"
        share = self.prefix / "share/mapweave"
        self.assertIn(f"{share} {share}/mapweave_ros\n", self.asked(PYTHON, "-c", find))
        self.assertTrue(self.asked(share / "mapweave_ros", "--version").startswith("mapweave_ros "))
        self.assertTrue(self.asked(self.prefix / "bin/mapweave_ros", "--version").startswith("mapweave_ros "))
        self.assertEqual(self.asked("rossrv", "show", "mapweave_msgs/UndoJoin"), "string a\nstring b\n---\nbool success\nstring message\n\n")
        self.assertEqual(self.asked(PYTHON, "-c", "from mapweave_msgs.srv import UndoJoin; print(UndoJoin._request_class.__slots__)"), "['a', 'b']\n")
        self.assertEqual(self.asked(PYTHON, "-c", "from mapweave_msgs.srv import SetInitialPose; print(SetInitialPose._response_class.__slots__)"), "['success', 'message']\n")
        self.assertIn("float64 sigma_yaw", self.asked("rossrv", "show", "mapweave_msgs/SetInitialPose"))
        for package in ("mapweave", "mapweave_msgs"):
            self.assertIn(f"{package} ", self.asked(PYTHON, "-c", f"from catkin_pkg.package import parse_package as parse\nparsed = parse('{share.parent / package}')\n"
                                                                  "print(parsed.name, parsed.version)"))

    def test_each_role_has_a_manual_page_with_all_of_its_options(self):
        pages = {page.name.removesuffix(".1.gz"): gzip.decompress(page.read_bytes()).decode().replace("\\-", "-") for page in self.prefix.glob("share/man/man1/*")}
        roles = ("team", "robot", "edge", "cloud", "coordinator")
        self.assertEqual(set(pages), {"mapweave_ros", *(f"mapweave_ros-{role}" for role in roles)})
        for role in roles:
            self.assertIn(f"\\fB{role}\\fR", pages["mapweave_ros"])
            options = set(re.findall(r"^  (-\S+)", self.asked(self.prefix / "bin/mapweave_ros", role, "--help"), re.MULTILINE))
            self.assertGreater(len(options), 1)
            for option in options:
                self.assertIn(f"\\fB{option}", pages[f"mapweave_ros-{role}"], role)

    def test_launch_files_name_their_nodes_and_start_what_they_say(self):
        config = "config:=of fice.yaml"   # paths may have blanks
        commands = {
            ("team.launch", "mapweave_team", "robots:=tb0 tb1", "out:=a map"): ["team", "tb0", "tb1", "--out", "a map", "--port", "0"],
            ("team.launch", "mapweave_team", config, "out:=map", "port:=-1", "options:=--force"): ["team", "of fice.yaml", "--out", "map", "--port", "-1", "--force"],
            ("robot.launch", "mapweave_robot_tb_0", config, "name:=tb-0"): ["robot", "of fice.yaml", "--name", "tb-0"],
            ("edge.launch", "mapweave_edge_north", config, "name:=north", "options:=--threads 1"): ["edge", "of fice.yaml", "--name", "north", "--threads", "1"],
            ("cloud.launch", "mapweave_cloud", config, "out:=map"): ["cloud", "of fice.yaml", "--out", "map"],
            ("coordinator.launch", "mapweave_coordinator", config, "out:=plans"): ["coordinator", "of fice.yaml", "--out", "plans"]}
        self.assertEqual({words[0] for words in commands} | {"all.launch"}, {file.name for file in self.prefix.glob("share/mapweave/launch/*.launch")})
        for (file, node, *arguments), expected in commands.items():
            self.assertEqual(self.asked("roslaunch", "--nodes", "mapweave", file, *arguments), f"/{node}\n")
            command = self.asked("roslaunch", "--args", f"/{node}", "mapweave", file, *arguments)
            start = [str(self.prefix / "share/mapweave/keep_running"), *(["--service"] if expected[0] != "team" else []),
                     *(["--until", "map"] if expected[0] == "cloud" else []),
                     str(self.prefix / "share/mapweave/mapweave_ros"), *expected, f"__name:={node}"]
            self.assertEqual(command.strip(), " ".join(start))
        nodes = self.asked("roslaunch", "--nodes", "mapweave", "all.launch", config, "out:=map", "coordinator:=true").split()
        self.assertEqual(sorted(nodes), sorted(f"/mapweave_{name}" for name in ("broker", "cloud", "coordinator", "edge_north", "robot_alpha", "robot_beta")))

    def test_a_wrong_command_line_ends_roslaunch(self):
        launched = self.launch("team.launch", "out:=map")
        self.assert_ends(launched, 0)
        self.assertIn("ROBOT is missing", launched.log.read_text())
        self.assertIn("exit code 2", launched.log.read_text())

    def test_a_team_is_mapped_though_its_node_is_killed(self):
        launched = self.launch("team.launch", "robots:=alpha beta", "out:=maps/room", "options:=--set live.preview_period_s=0.5")
        player = self.play(drives(80), 8.0)
        self.await_word(player, "begins")
        time.sleep(0.5)
        self.kill_node(launched, "team")
        self.await_word(launched, "it is started again")
        self.await_word(launched, "goes on with the recording")
        self.assert_ends(player, 0)
        self.call("/team/finish")
        self.assert_ends(launched, 0)
        self.assertIn("has finished cleanly", launched.log.read_text())
        self.assertEqual(self.children_of(launched), {})
        self.assert_map_of_what_was_recorded("maps/room", "maps/room.logs/run.yaml")

    def assert_map_of_what_was_recorded(self, out, configuration):
        self.mapweave("run", configuration, "--out", "batch")
        self.assertEqual((self.folder / out / "team/map.mwdb").read_bytes(), (self.folder / "batch/team/map.mwdb").read_bytes())
        for robot in self.read_json(f"{out}/summary.json")["robots"]:
            self.assertGreater(robot["scans"], 20, robot["id"])
        self.assertEqual(self.read_json(f"{out}/summary.json")["team"]["members"], [["alpha", "beta"]])

    def test_names_are_remapped_in_launch_files_of_one_s_own(self):
        self.write("own.launch", """<launch>
  <node pkg="mapweave" type="mapweave_ros" name="mapper" output="screen" required="true" args="team alpha --out maps --port -1">
    <remap from="/alpha/scan" to="/alpha/front/scan"/>
  </node>
</launch>
""")
        launched = self.begin("roslaunch", "-p", self.port, self.folder / "own.launch")
        messages = [(topic.replace("/scan", "/front/scan"), *rest) for topic, *rest in drives(40) if "/beta/" not in topic]
        self.assert_ends(self.play(messages, 8.0), 0)
        self.call("/team/finish")
        self.assert_ends(launched, 0)
        self.assertIn("records /alpha/scan, /alpha/odom,", launched.log.read_text())
        self.mapweave("slam", next(self.folder.rglob("alpha.mcap")), "--out", "batch")
        self.assertGreater(self.read_json("batch/summary.json")["robots"][0]["scans"], 20)

    def test_a_coordinator_gives_robots_to_edges(self):
        self.write("office.yaml", """robots:
  - {id: alpha, log: recordings/alpha.mcap}
  - {id: beta, log: recordings/beta.mcap}
edges: [{id: north}, {id: south}]
coordinator: {method: default, overlap_period_s: 1}
""")
        broker = self.begin(serve_test.BROKER, "-js", "-a", "127.0.0.1", "-p", self.broker_port, "-sd", self.folder / "broker")
        self.await_word(broker, "Server is ready")
        roles = [("coordinator", ("out", "plans")), ("cloud", ("out", "maps/room")), *(("edge", ("name", edge)) for edge in ("north", "south")),
                 *(("robot", ("name", robot)) for robot in ROBOTS)]
        options = ("options", f"--set live.broker=nats://127.0.0.1:{self.broker_port} --set live.preview_period_s=0.5 --set live.store=store")
        self.write("office.launch", "<launch>\n" + "".join(
            f'<include file="$(find mapweave)/launch/{role}.launch">'
            + "".join(f'<arg name="{name}" value="{value}"/>' for name, value in [("config", "office.yaml"), ("required", "false"), own, options])
            + "</include>\n" for role, own in roles) + "</launch>\n")
        self.begin("rosmaster", "--core", "-p", self.port)   # beside a master of its own roslaunch stays when all nodes have ended
        self.await_(lambda: is_open(self.port), "the master")
        launched = self.begin("roslaunch", "-p", self.port, self.folder / "office.launch")
        player = self.play(drives(60), 4.0)
        self.await_word(player, "begins")
        plan = self.asked(PYTHON, "-c", "import rospy; from std_msgs.msg import String; from nav_msgs.msg import OccupancyGrid\nrospy.init_node('looker')\n"
                          "plan = ''\n"
                          "while 'alpha' not in plan: plan = rospy.wait_for_message('/coordinator/plan', String).data\n"  # the first plan may have one robot
                          "print(*plan.split())\n"
                          "print(rospy.wait_for_message('/alpha/map', OccupancyGrid).header.frame_id)", seconds=40)
        plan, frame = plan.strip().splitlines()
        self.assertRegex(plan, "alpha.*(north|south)")
        self.assertEqual(frame, "alpha/map")
        self.assert_ends(player, 0)
        for robot in ROBOTS:
            self.call(f"/{robot}/finish")
        self.assert_ends(launched, 0)
        plan = self.read_json("plans/plan.json")
        self.assertTrue(plan["done"])
        edge_of = {robot: edge["id"] for edge in plan["edges"] for robot in edge["robots"]}
        self.assertEqual(edge_of.keys(), ROBOTS.keys())
        self.write("as_planned.yaml", "robots:\n" + "".join(f"  - {{id: {robot}, log: recordings/{robot}.mcap, edge: {edge_of[robot]}}}\n" for robot in ROBOTS))
        self.assert_map_of_what_was_recorded("maps/room", "as_planned.yaml")

    def test_a_node_waits_for_its_broker_and_ends_where_its_recording_is_refused(self):
        self.write("office.yaml", "robots: [{id: alpha, log: recordings/alpha.mcap, edge: north}]\n")
        (self.folder / "recordings").mkdir()
        self.write("recordings/alpha.mcap", "what another program wrote\n")
        options = f"options:=--set live.broker=nats://127.0.0.1:{self.broker_port}"
        launched = self.launch("robot.launch", "config:=office.yaml", "name:=alpha", options)
        self.await_word(launched, "exit code 6; it is started again")
        self.assertIn("the broker cannot be reached", launched.log.read_text())
        broker = self.begin(serve_test.BROKER, "-js", "-a", "127.0.0.1", "-p", self.broker_port, "-sd", self.folder / "broker")
        self.await_word(broker, "Server is ready")
        self.assert_ends(launched, 0)
        said = launched.log.read_text()
        self.assertRegex(said, "alpha.mcap: .* was expected; move it away, or name another file")
        self.assertIn("exit code 3", said)
        self.assertEqual(said.count("it is started again"), 1)
        self.assertEqual((self.folder / "recordings/alpha.mcap").read_text(), "what another program wrote\n")

    def test_a_deployment_is_paused_and_goes_on_to_its_map(self):
        self.write("office.yaml", (self.prefix / "share/mapweave/launch/all.yaml").read_text())
        words = ["all.launch", "config:=office.yaml", "out:=maps/room", f"port:={self.broker_port}", "options:=--set live.preview_period_s=0.5"]
        launched = self.launch(*words)
        middle, messages = 1010.0, drives(100)
        player = self.play([message for message in messages if message[2] < middle], 8.0)
        self.await_word(player, "begins")
        self.kill_node(launched, "edge")
        self.await_word(launched, "it is started again")
        launched.send_signal(signal.SIGINT)
        self.assert_ends(launched, 0)
        self.assertFalse((self.folder / "maps/room").exists(), "Ctrl-C is a pause")
        self.assertNotIn("escalating", launched.log.read_text(), "they end at once")
        self.end(player)
        launched = self.launch(*words)
        self.await_word(launched, "goes on with the recording", 2)
        self.assert_ends(self.play([message for message in messages if message[2] >= middle or "tf" in message[0]], 8.0), 0)
        for robot in ROBOTS:
            self.call(f"/{robot}/finish")
        self.assert_ends(launched, 0)
        said = launched.log.read_text()
        self.assertIn("the cloud has written the team's map", said)
        self.assertNotIn("interrupted", said)
        self.assert_map_of_what_was_recorded("maps/room", "office.yaml")


if __name__ == "__main__":
    support.main()
