"""What tests of the nodes of ROS 1 share: a ROS master of their own, what robots publish, and what nodes say."""
import pathlib
import pickle
import socket
import subprocess
import time

import ros1_bags
import support

PYTHON = "/usr/bin/python3"
HERE = pathlib.Path(__file__).resolve().parent
NODES = support.PROGRAM.parent / "mapweave_ros"
SHIFTS = {"tb0": 0.0, "tb1": 0.8}


def free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


def missing():
    if not NODES.exists():
        return "this build has no nodes of ROS"
    probe = "import rospy, rosmaster, std_srvs.srv, nav_msgs.srv, map_msgs.srv, tf2_msgs.msg, visualization_msgs.msg, diagnostic_msgs.msg"
    done = subprocess.run([PYTHON, "-c", probe], capture_output=True, text=True, check=False)
    return done.stderr.strip().splitlines()[-1] if done.returncode else ""


def drives(robots=SHIFTS, scans=40):
    """What all robots publish, in the order of stamps."""
    messages = [message for robot, shift in robots.items() for message in ros1_bags.drive(scans, robot, shift)]
    return sorted(messages, key=lambda message: message[2])


class RosScenario(support.Scenario):
    def setUp(self):
        why = missing()
        if why:
            self.skipTest(why)
        super().setUp()
        self.port = free_port()
        self.variables = support.environment() | {
            "ROS_MASTER_URI": f"http://127.0.0.1:{self.port}", "ROS_IP": "127.0.0.1", "ROS_HOME": str(self.folder / "ros_home"),
            "PYTHONPATH": str(NODES.parent.parent / "lib/python3"), "PYTHONUNBUFFERED": "1"}
        self.start_master()

    def start_master(self):
        self.master = self.begin("rosmaster", "--core", "-p", self.port)
        self.await_(lambda: self.run_python("import rosgraph; rosgraph.Master('/t').getPid()", check=False).returncode == 0, "the master")

    def restart_master(self):
        """It forgets everything."""
        self.master.kill()
        self.master.wait()
        time.sleep(0.5)
        self.start_master()

    def begin(self, *command, **variables):
        name = pathlib.Path(str(command[0])).name + str(len(list(self.folder.glob("*.log"))))
        log = (self.folder / f"{name}.log").open("w+")
        process = subprocess.Popen([str(word) for word in command], cwd=self.folder, env=self.variables | variables, text=True,
                                   stdin=subprocess.PIPE, stdout=log, stderr=subprocess.STDOUT)
        process.log = self.folder / f"{name}.log"

        def end():
            process.poll() is None and process.kill()
            process.wait()
            process.stdin.close()
            log.close()
        self.addCleanup(end)
        return process

    def await_(self, condition, what, seconds=60):
        end = time.time() + seconds * support.PATIENCE
        while not condition():
            self.assertLess(time.time(), end, f"{what}\n" + "\n".join(f"--- {path.name}\n{path.read_text()[-3000:]}" for path in self.folder.glob("*.log")))
            time.sleep(0.05)

    def run_python(self, code, check=True, seconds=60):
        done = subprocess.run([PYTHON, "-c", code], cwd=self.folder, env=self.variables, capture_output=True, text=True,
                              timeout=seconds * support.PATIENCE, check=False)
        if check:
            self.assertEqual(done.returncode, 0, done.stdout + done.stderr)
        return done

    def call(self, service, kind, arguments=""):
        """What a service answers, as text."""
        package, name = kind.split("/")
        return self.run_python(f"import rospy; from {package}.srv import {name}\nrospy.init_node('caller', anonymous=True)\n"
                               f"rospy.wait_for_service('{service}', 20)\nprint(rospy.ServiceProxy('{service}', {name})({arguments}))").stdout

    def play(self, messages, speed=4.0, subscribers=1, *modes):
        (self.folder / "messages").write_bytes(pickle.dumps(messages))
        return self.begin(PYTHON, "-B", HERE / "ros_player.py", "messages", speed, subscribers, MAPWEAVE_PLAYER=" ".join(modes))

    def has_said(self, process, words):
        return words in process.log.read_text()

    def await_word(self, process, words):
        self.await_(lambda: self.has_said(process, words), words)

    def team(self, *more, robots=SHIFTS):
        return self.begin(NODES, "team", *robots, "--out", "maps", "--port", "-1", "--set", "live.preview_period_s=0.5", *more)

    def finish(self, node):
        self.assertIn("success: True", self.call("/team/finish", "std_srvs/Trigger"))
        node.wait(120 * support.PATIENCE)
        self.assertEqual(node.returncode, 0, node.log.read_text())

    def same_as_batch(self, *scans):
        """The map is that of a run of what was recorded. `scans`: how many each robot may have."""
        self.mapweave("run", "maps.logs/run.yaml", "--out", "batch")
        for name in ["team/map.pgm", "team/map.mwdb", "robots/tb0/map.pgm", "robots/tb1/trajectory.tum"]:
            self.assertEqual((self.folder / "maps" / name).read_bytes(), (self.folder / "batch" / name).read_bytes(), name)
        for robot in self.read_json("maps/summary.json")["robots"]:
            self.assertIn(robot["scans"], scans, robot["id"])

    def start_broker(self):
        import serve_test
        if serve_test.BROKER is None:
            self.skipTest("needs nats-server")
        port = free_port()
        broker = self.begin(serve_test.BROKER, "-js", "-a", "127.0.0.1", "-p", port, "-sd", self.folder / "broker")
        self.await_word(broker, "Server is ready")
        return f"nats://127.0.0.1:{port}"
