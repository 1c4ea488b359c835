"""A deployment whose broker lets in only its own programs: certificates and users made by `serve keys`."""
import json
import re
import socket
import ssl
import stat
import subprocess
import time
import unittest

import serve_test
import support

WORLD = """\
laser: {rays: 91, scans_per_second: 2.0}
robots:
  - {id: alpha, edge: north, length_m: 8, first_room: 0}
  - {id: beta, edge: north, length_m: 8, first_room: 1}
"""


class Broker:
    """What a stranger sees who speaks NATS by hand."""

    def __init__(self, port, keys):
        self.socket = socket.create_connection(("127.0.0.1", port), timeout=20)
        assert b"INFO" in self.socket.recv(65536)
        context = ssl.create_default_context(cadata=keys["authority"])
        self.socket = context.wrap_socket(self.socket, server_hostname="127.0.0.1")
        self.socket.settimeout(20)
        login = {"user": keys["user"], "pass": keys["password"], "verbose": False, "pedantic": False, "tls_required": True, "lang": "test", "version": "1"}
        self.socket.sendall(b"CONNECT " + json.dumps(login).encode() + b"\r\nPING\r\n")

    def answer(self, *commands):
        """All that it says until it answers a ping after these commands, or ends."""
        self.socket.sendall("".join(f"{command}\r\n" for command in (*commands, "PING")).encode())
        said = b""
        pongs = 2 if not hasattr(self, "asked") else 1
        self.asked = True
        while said.count(b"PONG") < pongs and (some := self.socket.recv(65536)):
            said += some
        return said.decode()


class ServeKeys(serve_test.WithBroker):
    def make_keys(self, port, code=support.DONE):
        return self.mapweave("serve", "keys", "logs/run.yaml", "--host", "127.0.0.1", "--port", port, "--out", "keys", code=code)

    def start_guarded_broker(self, port, folder="keys"):
        broker = subprocess.Popen([serve_test.BROKER, "-c", "broker.conf"], cwd=self.folder / folder, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
        self.addCleanup(broker.wait)
        self.addCleanup(broker.kill)
        end = time.monotonic() + 20 * support.PATIENCE
        while True:
            try:
                return socket.create_connection(("127.0.0.1", port), timeout=1).close()
            except OSError:
                self.assertLess(time.monotonic(), end, "the broker does not start")
                time.sleep(0.05)

    def test_programs_with_keys_make_the_map_of_a_run_and_others_are_kept_out(self):
        self.mapweave("simulate", self.write("world.yaml", WORLD), "--out", "logs")
        self.mapweave("run", "logs/run.yaml", "--out", "run", code=(support.DONE, support.APART))
        port = serve_test.free_port()
        made = self.make_keys(port)
        self.assertIn("7 users", made.stdout)
        for path in (self.folder / "keys").iterdir():
            self.assertEqual(stat.S_IMODE(path.stat().st_mode) & 0o077, 0, f"{path.name} can be read by others")
        self.start_guarded_broker(port)
        talk = ["--set", f"live.broker=nats://127.0.0.1:{port}", "--set", "live.speed=0"]
        look = ["doctor", "logs/run.yaml", "--json", *talk[:2], "--set", "live.keys=keys/doctor.keys"]
        nobody = json.loads(self.mapweave(*look, code=support.GATE_FAILED).stdout)
        self.assertEqual([program["silent_seconds"] for program in nobody["deployment"]["programs"]], [None] * 4)
        self.assertFalse(nobody["is_healthy"])
        cloud = self.start("serve", "cloud", "logs/run.yaml", "--out", "live", *talk, "--set", "live.keys=keys/cloud.keys")
        edge = self.start("serve", "edge", "logs/run.yaml", *talk, "--set", "live.keys=keys/edge-north.keys")
        robots = [self.start("serve", "robot", "logs/run.yaml", "--name", name, *talk, "--set", f"live.keys=keys/robot-{name}.keys")
                  for name in ("alpha", "beta")]
        for robot in robots:
            self.end(robot)
        self.assertIn(cloud.wait(120 * support.PATIENCE), (support.DONE, support.APART))
        self.end(edge)
        self.assert_same_map("live", "run")
        found = json.loads(self.mapweave(*look).stdout)
        self.assertTrue(found["is_healthy"], found)
        programs = {program["program"]: program for program in found["deployment"]["programs"]}
        self.assertEqual(sorted(programs), ["cloud", "edge-north", "robot-alpha", "robot-beta"])
        for name, program in programs.items():
            self.assertTrue(program["status"]["tiers"][0]["is_done"], name)
            self.assertLess(abs(program["clock_offset_seconds"]), 1.0, name)

        worker = self.start("worker", "--cluster", f"nats://127.0.0.1:{port}", "--keys", "keys/worker.keys")
        self.mapweave("run", "logs/run.yaml", "--cluster", f"nats://127.0.0.1:{port}", "--set", "live.keys=keys/run.keys", "--out", "spread",
                      code=(support.DONE, support.APART), seconds=120)
        self.assert_same_map("spread", "run")
        worker.terminate()
        self.assertIn("2 robots mapped", self.end(worker)[1])

        keys = self.read_json("keys/robot-alpha.keys")
        alpha = Broker(port, keys)
        self.assertNotIn("Violation", alpha.answer("PUB mw.edge_north_up.0.alpha 1\r\nx"))
        for subject in ("mw.edge_north_up.0.beta", "mw.cloud_north_up.0.north", "$JS.API.STREAM.DELETE.edge_north_up_0", "$JS.API.STREAM.CREATE.edge_north_up_0",
                        "$JS.API.CONSUMER.MSG.NEXT.cloud_north_up_0.north"):
            self.assertIn("Permissions Violation for Publish", alpha.answer(f"PUB {subject} 1\r\nx"), subject)
        for subject in ("_INBOX.>", "mw.>", ">", "_INBOX_robot-beta.>"):
            self.assertIn("Permissions Violation for Subscription", alpha.answer(f"SUB {subject} 1"), subject)
        self.assertIn("Authorization Violation", Broker(port, {**keys, "password": "wrong"}).answer())
        self.write("wrong.keys", json.dumps({**keys, "password": "wrong"}))
        self.mapweave("serve", "keys", "logs/run.yaml", "--host", "127.0.0.1", "--port", port, "--out", "other")   # of another authority
        for verb in (["doctor", "logs/run.yaml"], ["serve", "robot", "logs/run.yaml", "--name", "alpha"]):
            for file, words in (("wrong.keys", "Authorization Violation"), ("other/robot-alpha.keys", "issuer")):
                refused = self.mapweave(*verb, *talk[:2], "--set", f"live.keys={file}", code=support.BAD_INPUT)
                self.assertIn(words, refused.stderr)
                self.assertIn("check user, password, token and certificates", refused.stderr)

    def test_an_edge_with_its_own_broker_works_before_the_cloud_is_there(self):
        self.mapweave("simulate", self.write("world.yaml", WORLD.replace("id: beta, edge: north", "id: beta, edge: south")), "--out", "logs")
        self.mapweave("run", "logs/run.yaml", "--out", "run", code=(support.DONE, support.APART))
        hub, leaf, leaves = (serve_test.free_port() for _ in range(3))
        run = self.folder / "logs/run.yaml"
        run.write_text(run.read_text() + f"edges: [{{id: north, broker: 'nats://127.0.0.1:{leaf}'}}, {{id: south}}]\n")
        made = self.mapweave("serve", "keys", "logs/run.yaml", "--host", "127.0.0.1", "--port", hub, "--leaf-port", leaves, "--out", "keys")
        self.assertIn("9 users: ", made.stdout)
        self.assertIn("broker of edge north: copy broker-of-north to 127.0.0.1", made.stdout)
        talk = ["--set", f"live.broker=nats://127.0.0.1:{hub}", "--set", "live.speed=0"]

        def start(role, name, *arguments):
            return self.start("serve", role, "logs/run.yaml", *arguments, *talk, "--set", f"live.keys=keys/{name}.keys")

        self.start_guarded_broker(leaf, "keys/broker-of-north")
        edges = [start("edge", "edge-north", "--name", "north")]
        self.end(start("robot", "robot-alpha", "--name", "alpha"))  # while neither the cloud nor its broker is there
        self.start_guarded_broker(hub)
        edges.append(start("edge", "edge-south", "--name", "south"))
        robot = start("robot", "robot-beta", "--name", "beta")
        cloud = start("cloud", "cloud", "--out", "live")
        self.end(robot)
        self.assertIn(cloud.wait(120 * support.PATIENCE), (support.DONE, support.APART))
        for edge in edges:
            self.end(edge)
        self.assert_same_map("live", "run")
        look = ["doctor", "logs/run.yaml", "--json", *talk[:2], "--set", "live.keys=keys/doctor.keys"]
        found = json.loads(self.mapweave(*look).stdout)
        self.assertTrue(found["is_healthy"], found)
        self.assertEqual([program["program"] for program in found["deployment"]["programs"] if program["silent_seconds"] is None], [],
                         "alpha had ended before the cloud's broker began")
        leaf = Broker(hub, self.read_json("keys/leaf-north.keys"))   # who has taken it over
        self.assertNotIn("Violation", leaf.answer("PUB $JS.ACK.cloud_north_down_0.north.1 1\r\nx"))
        for subject in ("mw.cloud_south_up.0.south", "mw.edge_south_up.0.beta", "mw.status.edge-south", "$JS.ACK.cloud_south_down_0.south.1", "$JS.cloud.API.STREAM.DELETE.cloud_south_up_0"):
            self.assertIn("Permissions Violation for Publish", leaf.answer(f"PUB {subject} 1\r\nx"), subject)
        for subject in ("mw.>", "_INBOX_cloud.>", "_INBOX_edge-south.>"):
            self.assertIn("Permissions Violation for Subscription", leaf.answer(f"SUB {subject} 1"), subject)

    def test_a_coordinator_with_keys_gives_robots_to_edges(self):
        self.mapweave("simulate", self.write("world.yaml", WORLD), "--out", "logs")
        run = self.folder / "logs/run.yaml"
        run.write_text(re.sub(r', edge: "\w+"', "", run.read_text()) + "\nedges: [{id: north}, {id: south}]\ncoordinator: {method: default, overlap_period_s: 2}\n")
        port = serve_test.free_port()
        self.assertIn("9 users", self.make_keys(port).stdout)
        self.start_guarded_broker(port)
        talk = ["--set", f"live.broker=nats://127.0.0.1:{port}", "--set", "live.speed=0"]
        start = lambda role, user, *rest: self.start("serve", role, "logs/run.yaml", *rest, *talk, "--set", f"live.keys=keys/{user}.keys")
        cloud = start("cloud", "cloud", "--out", "live")
        coordinator = start("coordinator", "coordinator", "--out", "plans")
        edges = [start("edge", f"edge-{name}", "--name", name) for name in ("north", "south")]
        robots = [start("robot", f"robot-{name}", "--name", name) for name in ("alpha", "beta")]
        self.assertIn(cloud.wait(120 * support.PATIENCE), (support.DONE, support.APART))
        for process in (*robots, *edges, coordinator):
            self.end(process)
        placed = {robot for edge in self.read_json("plans/plan.json")["edges"] for robot in edge["robots"]}
        self.assertEqual(placed, {"alpha", "beta"})
        self.assertTrue(all(robot["mapped"] for robot in self.read_json("live/summary.json")["robots"]))
        alpha = Broker(port, self.read_json("keys/robot-alpha.keys"))
        for subject in ("mw.edge_south_up.0.alpha", "mw.edge_north_up.0.alpha"):
            self.assertNotIn("Violation", alpha.answer(f"PUB {subject} 1\r\nx"), subject)
        for subject in ("mw.edge_south_up.0.beta", "mw.plan.coordinator", "mw.status.coordinator", "mw.status.maps-north", "$JS.API.STREAM.CREATE.plan", "$JS.API.STREAM.MSG.GET.status"):
            self.assertIn("Permissions Violation for Publish", alpha.answer(f"PUB {subject} 1\r\nx"), subject)

    def test_cameras_with_keys_share_on_wires_of_their_own_robot_alone(self):
        self.mapweave("simulate", self.write("world.yaml", serve_test.CAMERA_WORLD), "--out", "logs")
        run = self.folder / "logs/run.yaml"
        run.write_text(run.read_text() + "\nsensor: cameras\nserver: {share: view}\n")
        port = serve_test.free_port()
        self.make_keys(port)
        self.start_guarded_broker(port)
        talk = ["--set", f"live.broker=nats://127.0.0.1:{port}"]
        start = lambda role, user, *rest: self.start("serve", role, "logs/run.yaml", *rest, *talk, "--set", f"live.keys=keys/{user}.keys")
        cloud = start("cloud", "cloud", "--out", "live")
        edge = start("edge", "edge-north")
        robots = [start("robot", f"robot-{name}", "--name", name) for name in ("alpha", "beta")]
        self.assertIn(cloud.wait(120 * support.PATIENCE), (support.DONE, support.APART))
        for process in (*robots, edge):
            self.end(process)
        for robot in self.read_json("live/summary.json")["robots"]:
            self.assertGreater(robot["cameras"][0]["sent_bytes"], 1000, "its camera map server bade welcome")

        def may_publish(user, *subjects):
            stranger = Broker(port, self.read_json(f"keys/{user}.keys"))
            with stranger.socket:
                return ["Violation" not in stranger.answer(f"PUB {subject} 1\r\nx") for subject in subjects]

        own = [f"mw.cameras_north_up.{number}.alpha=2e{camera}" for number in (0, 1) for camera in (0, 7)]
        self.assertEqual(may_publish("robot-alpha", *own), [True] * 4)
        self.assertEqual(may_publish("robot-beta", *own), [False] * 4)
        self.assertEqual(may_publish("robot-alpha", "mw.cameras_north_down.0.alpha=2e0", "$JS.API.STREAM.CREATE.cameras_north_up_0", "$JS.API.STREAM.DELETE.cameras_north_up_1",
                                     "$JS.API.CONSUMER.MSG.NEXT.cameras_north_down_1.beta=2e0", "$JS.API.CONSUMER.MSG.NEXT.cameras_north_up_1.alpha=2e0"), [False] * 5)
        self.assertEqual(may_publish("edge-north", "mw.cameras_north_down.1.alpha=2e0", "mw.cameras_north_up.1.alpha=2e0"), [True, False])

    def test_keys_stay_where_robots_are_added_and_what_is_wrong_is_said(self):
        self.mapweave("simulate", self.write("world.yaml", WORLD), "--out", "logs")
        self.make_keys(4222)
        before = {path.name: path.read_bytes() for path in (self.folder / "keys").glob("*.keys")}
        run = self.folder / "logs/run.yaml"
        run.write_text(run.read_text() + '  - {id: "gamma", log: "alpha.rawlog", edge: "south"}\n')
        self.assertIn("9 users, 7 of them known before", self.make_keys(4222).stdout)
        for name, content in before.items():
            self.assertEqual((self.folder / "keys" / name).read_bytes(), content)
        configuration = self.read_json("keys/broker.conf")
        self.assertEqual({user["user"] for user in configuration["authorization"]["users"]},
                         {"robot-alpha", "robot-beta", "robot-gamma", "edge-north", "edge-south", "cloud", "doctor", "worker", "run"})
        done = self.mapweave("serve", "keys", "logs/run.yaml", "--host", "no host", "--out", "other", code=support.BAD_INPUT)
        self.assert_says(done, "'no host' is neither a host's name nor an IP address")
        done = self.mapweave("serve", "keys", "logs/run.yaml", "--host", "127.0.0.1", "--out", "other", "--set", "edges=[{id: north, broker: here}, {id: south}]",
                             code=support.BAD_INPUT)
        self.assert_says(done, "the broker of edge 'north' has no address", "nats://10.0.0.2:4222")
        far = ["serve", "robot", "logs/run.yaml", "--name", "alpha", "--set", "live.broker=nats://192.0.2.1:4222"]
        self.assert_says(self.mapweave(*far, code=support.BAD_INPUT), "no keys", "serve keys", "live.unprotected")
        self.assert_says(self.mapweave(*far, "--set", "live.keys=nowhere.keys", code=support.BAD_INPUT), "nowhere.keys")
        self.write("broken.keys", '{"user": "robot-alpha"}')
        self.assert_says(self.mapweave(*far, "--set", "live.keys=broken.keys", code=support.BAD_INPUT), "broken.keys", "password")
        done = self.mapweave(*far, "--set", "live.unprotected=true", code=support.UNANSWERED)
        self.assert_says(done, "not protected", "can read all maps")


if __name__ == "__main__":
    support.main()
