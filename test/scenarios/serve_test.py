"""Robots, edges and a cloud as programs of their own, through a broker on this machine: the map of a run, though one of them is killed."""
import json
import os
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import sys
import threading
import time
import unittest
import urllib.error
import urllib.request

import browser
import support

BROKER = shutil.which("nats-server") or shutil.which("nats-server", path="/usr/sbin:/usr/local/bin")
WORLD = """\
laser: {rays: 91, scans_per_second: 2.0}
robots:
  - {id: alpha, edge: north, length_m: 14, first_room: 0}
  - {id: beta, edge: south, length_m: 14, first_room: 1}
  - {id: gamma, edge: north, length_m: 14, first_room: 2}
"""
CAMERA_WORLD = """\
cameras:
  - {id: front, kind: rgbd, width: 160, height: 120, fx: 131, fy: 131, frames_per_second: 8}
robots:
  - {id: alpha, edge: north, length_m: 3, first_room: 0}
  - {id: beta, edge: north, length_m: 3, first_room: 0}
"""


def free_port():
    with socket.socket() as listener:
        listener.bind(("127.0.0.1", 0))
        return listener.getsockname()[1]


def ask(port, path, method="GET"):
    """Status and text of an answer; (0, "") where nobody listens yet."""
    try:
        request = urllib.request.Request(f"http://127.0.0.1:{port}{path}", method=method, data=b"x" if method == "POST" else None)
        with urllib.request.urlopen(request, timeout=60 * support.PATIENCE) as answer:
            return answer.status, answer.read().decode()
    except urllib.error.HTTPError as error:
        return error.code, error.read().decode()
    except urllib.error.URLError:
        return 0, ""


def findings(port):
    text = ask(port, "/status.json")[1]
    return json.dumps([tier["findings"] for tier in json.loads(text)["tiers"]]) if text else ""


def next_event(stream):
    for line in stream:
        if line.startswith(b"data: "):
            return json.loads(line[6:])
    raise EOFError("the stream has ended")


def without_seconds(value):
    if isinstance(value, dict):
        return {key: without_seconds(one) for key, one in value.items() if key != "seconds"}
    return [without_seconds(one) for one in value] if isinstance(value, list) else value


class Outcome(unittest.TestResult):
    """Of one test, to be reported to another result."""

    def __init__(self):
        super().__init__()
        self.said = []

    def __getattribute__(self, name):
        if name in ("addSuccess", "addError", "addFailure", "addSkip", "addSubTest"):
            return lambda *arguments: self.said.append((name, arguments))
        return super().__getattribute__(name)

    def is_failure(self):
        return any(name in ("addError", "addFailure") for name, _ in self.said)

    def report_to(self, test, result):
        result.startTest(test)
        for name, arguments in self.said:
            getattr(result, name)(*arguments)
        result.stopTest(test)


class WithBroker(support.Scenario):
    """What tests of programs that talk share. On a busy machine a broker was seen to go away right after its start; who runs it as a
    service starts it again. A test that failed where its broker had ended is run once more, and what the broker said is shown."""

    lost_broker = None

    def run(self, result=None):
        outcome = Outcome()
        super().run(outcome)
        if outcome.is_failure() and self.lost_broker is not None:
            print(f"{self.id()}: the broker ended by itself ({self.lost_broker}); once more", file=sys.stderr, flush=True)
            outcome = Outcome()
            super().run(outcome)
        outcome.report_to(self, result)
        return result

    def look_at_broker(self, broker, errors):
        if broker.poll() is not None:
            self.lost_broker = f"code {broker.returncode}: {errors.read_text()[-500:]}"

    def setUp(self):
        super().setUp()
        if BROKER is None:
            raise unittest.SkipTest("needs nats-server, of the Debian package nats-server")

    def start_broker(self):
        port = free_port()
        errors = self.folder / "broker-errors.txt"
        with errors.open("w") as said:
            broker = subprocess.Popen([BROKER, "-js", "-a", "127.0.0.1", "-p", str(port), "-sd", str(self.folder / "streams")],
                                      stdout=subprocess.DEVNULL, stderr=said)
        self.addCleanup(broker.wait)
        self.addCleanup(broker.kill)
        self.addCleanup(self.look_at_broker, broker, errors)
        return f"nats://127.0.0.1:{port}"

    def simulate(self):
        self.mapweave("simulate", self.write("world.yaml", WORLD), "--out", "logs")

    def outputs(self, folder):
        return self.read_json(f"{folder}/manifest.json")["outputs"]

    def assert_same_map(self, live, run):
        """All but the configuration, which says how programs talk."""
        one, other = self.outputs(live), self.outputs(run)
        for papers in (one, other):
            papers.pop("config.yaml")
        self.assertGreater(len(other), 20)
        self.assertEqual(one, other)
        self.assertEqual(without_seconds(self.read_json(f"{live}/merges.json")), without_seconds(self.read_json(f"{run}/merges.json")))

    def wait_for(self, condition, what, seconds=60):
        end = time.monotonic() + seconds * support.PATIENCE
        while not condition():
            self.assertLess(time.monotonic(), end, what)
            time.sleep(0.05)

    def end(self, process, seconds=120):
        out, error = process.communicate(timeout=seconds * support.PATIENCE)
        self.assertEqual(process.returncode, support.DONE, error)
        return out, error


class Serve(WithBroker):
    def test_an_edge_is_killed_and_the_map_is_the_one_of_a_run(self):
        self.simulate()
        self.mapweave("run", "logs/run.yaml", "--out", "run")
        talk = ["--set", f"live.broker={self.start_broker()}", "--set", "live.speed=4", "--set", "live.preview_period_s=1"]
        cloud = self.start("serve", "cloud", "logs/run.yaml", "--out", "live", *talk)
        edges = {name: self.start("serve", "edge", "logs/run.yaml", "--name", name, *talk) for name in ("north", "south")}
        robots = [self.start("serve", "robot", "logs/run.yaml", "--name", name, *talk) for name in ("alpha", "beta", "gamma")]
        journal = self.folder / "mapweave-store/north.mwj-wal"
        self.wait_for(lambda: journal.exists() and journal.stat().st_size > 60000, "the edge keeps nothing")
        edges["north"].send_signal(signal.SIGKILL)
        edges["north"].wait()
        self.assertTrue(all(robot.poll() is None for robot in robots), "the robots drive still")
        time.sleep(1.0)
        edges["north"] = self.start("serve", "edge", "logs/run.yaml", "--name", "north", *talk)
        for robot in robots:
            self.assertIn("its edge has all", self.end(robot)[1])
        out, _ = self.end(cloud)
        self.assertIn("alpha", out)
        for edge in edges.values():
            self.end(edge)
        self.assert_same_map("live", "run")
        self.assertFalse((self.folder / "mapweave-store").exists(), "what was received is in the results")

    def test_the_cloud_starts_a_broker_where_none_is_named_and_is_killed_with_it(self):
        with socket.socket() as listener:
            if listener.connect_ex(("127.0.0.1", 4222)) == 0:
                raise unittest.SkipTest("needs port 4222, where a broker is looked for that is not named")
        self.simulate()
        self.mapweave("run", "logs/run.yaml", "--out", "run")
        talk = ["--set", "live.speed=4", "--set", "live.preview_period_s=1"]
        cloud = self.start("serve", "cloud", "logs/run.yaml", "--out", "live", *talk)
        others = [self.start("serve", role, "logs/run.yaml", "--name", name, *talk)
                  for role, name in (("edge", "north"), ("edge", "south"), ("robot", "alpha"), ("robot", "beta"), ("robot", "gamma"))]
        journal = self.folder / "mapweave-store/north.mwj-wal"
        self.wait_for(lambda: journal.exists() and journal.stat().st_size > 60000, "the edge keeps nothing")
        cloud.send_signal(signal.SIGKILL)
        cloud.wait()
        self.assertTrue(all(process.poll() is None for process in others), "they wait for the broker")
        cloud = self.start("serve", "cloud", "logs/run.yaml", "--out", "live", *talk)
        for process in [*others[2:], cloud, *others[:2]]:
            self.end(process)
        self.assert_same_map("live", "run")
        self.assertFalse((self.folder / "mapweave-store").exists(), "what was received is in the results")

    def test_what_standard_input_brings_is_mapped_as_it_comes(self):
        self.simulate()
        self.mapweave("run", "logs/run.yaml", "--out", "run")
        shutil.copytree(self.folder / "logs", self.folder / "site")
        sensed = (self.folder / "site/alpha.rawlog").read_bytes()
        (self.folder / "site/alpha.rawlog").unlink()
        talk = ["--set", f"live.broker={self.start_broker()}", "--set", "live.speed=0"]
        cloud = self.start("serve", "cloud", "site/run.yaml", "--out", "live", *talk)
        edges = [self.start("serve", "edge", "site/run.yaml", "--name", name, *talk) for name in ("north", "south")]
        robots = [self.start("serve", "robot", "site/run.yaml", "--name", name, *talk) for name in ("beta", "gamma")]
        fed = subprocess.Popen([support.PROGRAM, "serve", "robot", "site/run.yaml", "--name", "alpha", "--stdin", *talk], cwd=self.folder,
                               env=support.environment(), stdin=subprocess.PIPE, stderr=subprocess.PIPE)
        self.addCleanup(lambda: fed.poll() is None and fed.kill())
        step = len(sensed) // 40 + 1
        for begin in range(0, len(sensed), step):
            fed.stdin.write(sensed[begin:begin + step])
            fed.stdin.flush()
            time.sleep(0.05)
        error = fed.communicate(timeout=120 * support.PATIENCE)[1].decode()
        self.assertEqual(fed.returncode, support.DONE, error)
        self.assertIn("its edge has all", error)
        for process in [*robots, cloud, *edges]:
            self.end(process)
        self.assertEqual((self.folder / "site/alpha.rawlog").read_bytes(), sensed, "it is kept as the robot's log")
        self.assert_same_map("live", "run")
        refused = subprocess.run([support.PROGRAM, "serve", "robot", "site/run.yaml", "--name", "alpha", "--stdin", *talk], cwd=self.folder,
                                 env=support.environment(), input=sensed, capture_output=True, timeout=60 * support.PATIENCE, check=False)
        self.assertEqual(refused.returncode, support.CANNOT_WRITE)
        self.assertIn(b"is there already", refused.stderr)

    def test_a_robot_whose_log_is_cut_sends_what_was_read_and_fails(self):
        self.simulate()
        log = self.folder / "logs/alpha.rawlog"
        log.write_bytes(log.read_bytes()[:log.stat().st_size * 2 // 3])
        self.mapweave("run", "logs/run.yaml", "--out", "run", "--keep-going", code=support.BAD_INPUT)
        talk = ["--set", f"live.broker={self.start_broker()}", "--set", "live.speed=0"]
        cloud = self.start("serve", "cloud", "logs/run.yaml", "--out", "live", *talk)
        edges = [self.start("serve", "edge", "logs/run.yaml", "--name", name, *talk) for name in ("north", "south")]
        robots = {name: self.start("serve", "robot", "logs/run.yaml", "--name", name, *talk) for name in ("alpha", "beta", "gamma")}
        alpha = robots.pop("alpha")
        error = alpha.communicate(timeout=120 * support.PATIENCE)[1]
        self.assertIn("its edge has all", error)
        self.assertRegex(error, r"alpha\.rawlog.*\d")
        self.assertEqual(alpha.returncode, support.BAD_INPUT, error)
        for process in (*robots.values(), *edges):
            self.end(process)
        self.assertEqual(cloud.wait(120 * support.PATIENCE), support.BAD_INPUT, "as the run")
        self.assert_same_map("live", "run")

    def map_on_board(self, sensor):
        self.mapweave("simulate", self.write("world.yaml", CAMERA_WORLD), "--out", "logs")
        with_sensor = ["--set", f"sensor={sensor}"]
        self.mapweave("run", "logs/run.yaml", "--out", "run", *with_sensor, code=(support.DONE, support.APART))
        talk = ["--set", f"live.broker={self.start_broker()}", "--set", "live.speed=0", *with_sensor]
        cloud = self.start("serve", "cloud", "logs/run.yaml", "--out", "live", *talk)
        edge = self.start("serve", "edge", "logs/run.yaml", *talk)
        robots = [self.start("serve", "robot", "logs/run.yaml", "--name", name, *talk) for name in ("alpha", "beta")]
        for robot in robots:
            self.assertIn("its edge has all that it mapped", self.end(robot)[1])
        self.assertIn(cloud.wait(120 * support.PATIENCE), (support.DONE, support.APART))
        self.end(edge)
        self.assert_same_map("live", "run")

    def test_cameras_map_on_their_robots_and_the_map_is_the_one_of_a_run(self):
        self.map_on_board("cameras")
        self.assertIn("robots/beta/frames.png", self.outputs("live"))

    def test_a_laser_and_cameras_map_on_their_robot_and_the_map_is_the_one_of_a_run(self):
        self.map_on_board("all")
        for name in ("robots/beta/cameras/map.png", "robots/beta/cameras/frames.png", "robots/beta/map.pgm"):
            self.assertIn(name, self.outputs("live"))

    def test_the_demo_leaves_what_a_run_leaves(self):
        demo = self.mapweave("serve", "demo", "--out", "demo", "--speed", 8, seconds=150)
        self.assertIn("the cloud shows", demo.stderr)
        self.mapweave("run", "demo.logs/run.yaml", "--out", "run")
        self.assert_same_map("demo", "run")
        self.assertIn("merged", demo.stdout)

    def test_ctrl_c_ends_the_demo_with_what_was_seen(self):
        demo = self.start("serve", "demo", "--out", "demo", "--speed", 1)
        seen = []
        for line in demo.stderr:
            seen.append(line)
            if (found := re.search(r"alpha (\d+) scans", line)) and int(found[1]) > 30:
                break
        demo.send_signal(signal.SIGINT)
        out, error = demo.communicate(timeout=120 * support.PATIENCE)
        self.assertIn(demo.returncode, (support.DONE, support.APART), "".join(seen) + error)
        summary = self.read_json("demo/summary.json")
        self.assertTrue(all(robot["mapped"] for robot in summary["robots"]))
        self.assertIn("ended on request", json.dumps(summary["notes"]))
        self.assertIn("alpha", out)

    def start_demo(self, port):
        """It drives in real time; returns once its page answers."""
        demo = self.start("serve", "demo", "--out", "demo", "--speed", 1, "--port", port)
        read = []
        for line in demo.stderr:
            read.append(line)
            if f"see http://127.0.0.1:{port}/" in line:
                return demo
        self.fail("the demo shows no page: " + "".join(read))

    def test_the_demo_shows_a_page_that_is_live_and_ends_in_spite_of_who_looks(self):
        port = free_port()
        demo = self.start_demo(port)
        drain = threading.Thread(target=demo.stderr.read, daemon=True)
        drain.start()
        status, page = ask(port, "/")
        self.assertEqual(status, 200)
        self.assertIn("mapweave serve demo", page)
        self.assertEqual(ask(port, "/nothing")[0], 404)
        self.assertEqual(ask(port, "/", method="POST")[0], 405)
        self.assertEqual(ask(port, "/healthz"), (200, "ok\n"))
        with urllib.request.urlopen(f"http://127.0.0.1:{port}/events", timeout=60 * support.PATIENCE) as stream:
            scans, maps = [], []
            while not (maps and maps[-1] > 0 and scans[-1] > min(scans)):
                event = next_event(stream)
                tiers = {(tier["role"], tier["name"]): tier for tier in event["status"]["tiers"]}
                scans.append(tiers["robot", "alpha"]["counts"]["scans"])
                maps.append(event["maps"])
                self.assertEqual(sorted(tiers), [("cloud", "cloud"), ("edge", "north"), ("edge", "south"),
                                                 ("robot", "alpha"), ("robot", "beta"), ("robot", "gamma")])
            while not (shown := json.loads(ask(port, "/maps.json")[1]))["maps"]:   # they are small at first
                next_event(stream)
            self.assertGreater(shown["number"], 0)
            for one in shown["maps"]:
                self.assertTrue(one["trajectories"])
                self.assertTrue(one["grid"]["levels"][0]["png"].startswith("data:image/png"))
            links = {link["name"]: link for link in json.loads(ask(port, "/status.json")[1])["tiers"][0]["links"]}
            self.assertTrue(links["north"]["is_on_wire"] and links["south"]["is_on_wire"])
            metrics = ask(port, "/metrics")[1]
            self.assertRegex(metrics, r'(?m)^mapweave_link_scans_total\{role="edge",tier="north",peer_role="robot",peer="alpha"\} [1-9]')
            self.assertRegex(metrics, r"(?m)^mapweave_healthy 1$")
            guide = (support.ROOT / "apps/mapweave/guide/live.md").read_text()
            self.assertEqual([name for name in re.findall(r"(?m)^# TYPE (\S+)", metrics) if f"`{name}`" not in guide], [])
            demo.send_signal(signal.SIGINT)
            last = stream.read()   # until the program closes it
            self.assertTrue(last.endswith(b"event: end\ndata: {}\n\n"), last[-200:])
        self.assertIn(demo.wait(timeout=60 * support.PATIENCE), (support.DONE, support.APART))
        drain.join(timeout=60)

    @unittest.skipUnless(browser.chromium(), "chromium is not installed")
    def test_the_page_draws_itself_anew_without_an_error(self):
        port = free_port()
        demo = self.start_demo(port)
        drain = threading.Thread(target=demo.stderr.read, daemon=True)
        drain.start()
        with browser.Browser(seconds=60 * support.PATIENCE) as page:
            page.open(f"http://127.0.0.1:{port}/")
            self.wait_for(lambda: page.value("document.querySelectorAll('figure canvas').length") > 0, "no map is drawn")
            before = page.value("document.getElementById('robots').textContent")
            self.wait_for(lambda: page.value("document.getElementById('robots').textContent") != before, "nothing is new")
            self.assertEqual(page.value("document.querySelectorAll('section tbody tr').length > 6"), True)
            if os.environ.get("MAPWEAVE_SCREENSHOTS"):
                page.screenshot(pathlib.Path(os.environ["MAPWEAVE_SCREENSHOTS"]) / "live.png", whole=True)
            demo.send_signal(signal.SIGINT)
            self.assertIn(demo.wait(timeout=60 * support.PATIENCE), (support.DONE, support.APART))
            self.wait_for(lambda: "has ended" in page.value("document.getElementById('head').textContent"), "it does not know of the end")
            self.assertEqual(page.console, [])
            self.assertTrue(all(one.startswith(f"http://127.0.0.1:{port}/") for one in page.requests), page.requests)
        drain.join(timeout=60)

    def test_a_port_that_is_taken_is_said(self):
        with socket.socket() as listener:
            listener.bind(("127.0.0.1", 0))
            listener.listen()
            port = listener.getsockname()[1]
            done = self.mapweave("serve", "demo", "--out", "demo", "--port", port, code=support.BAD_INPUT)
        self.assert_says(done, f"127.0.0.1:{port}", "in use")
        self.assert_nothing_left("demo")

    def test_an_edge_and_a_cloud_show_pages_and_say_whom_they_miss(self):
        self.simulate()
        ports = {"cloud": free_port(), "edge": free_port()}
        broker = ["--set", f"live.broker={self.start_broker()}"]
        talk = [*broker, "--set", "live.patience_s=0.5"]
        cloud = self.start("serve", "cloud", "logs/run.yaml", "--out", "live", *talk, "--set", f"live.page_port={ports['cloud']}")
        edge = self.start("serve", "edge", "logs/run.yaml", "--name", "south", *talk, "--set", f"live.page_port={ports['edge']}")
        unhealthy = (503, "edge south: nobody")
        self.wait_for(lambda: "robot beta never came" in findings(ports["edge"]), "the edge misses its robot")
        self.wait_for(lambda: "edge north never came" in findings(ports["cloud"]) and "edge south" not in findings(ports["cloud"]), "the cloud misses an edge")
        self.assertEqual(ask(ports["cloud"], "/healthz"), (200, "ok\n"), "an edge is there")
        done = self.mapweave("doctor", "logs/run.yaml", *broker, code=support.GATE_FAILED)
        for words in ("edge-north: it never said anything", "mapweave serve edge CONFIG --name north", "robot beta never came", "something needs help"):
            self.assertIn(words, done.stdout)
        cloud.kill()
        cloud.wait()
        self.wait_for(lambda: ask(ports["edge"], "/healthz")[0] == unhealthy[0], "the edge is alone")
        self.assertIn(unhealthy[1], ask(ports["edge"], "/healthz")[1])
        edge.send_signal(signal.SIGINT)
        self.assertIn("goes on from", edge.communicate(timeout=60 * support.PATIENCE)[1])
        self.assertEqual(edge.returncode, support.INTERRUPTED)

    def stop(self, process):
        """As a service manager does."""
        process.send_signal(signal.SIGTERM)
        _, error = process.communicate(timeout=30 * support.PATIENCE)
        self.assertEqual(process.returncode, support.INTERRUPTED, error)

    def test_all_are_stopped_as_services_and_go_on_to_the_map_of_a_run(self):
        self.simulate()
        self.mapweave("run", "logs/run.yaml", "--out", "run")
        talk = ["--set", f"live.broker={self.start_broker()}", "--set", "live.speed=4"]
        programs = [("cloud", "--out", "live"), ("edge", "--name", "north"), ("edge", "--name", "south"),
                    *(("robot", "--name", name) for name in ("alpha", "beta", "gamma"))]
        start = lambda: [self.start("serve", role, "logs/run.yaml", *rest, *talk) for role, *rest in programs]
        running = start()
        journal = self.folder / "mapweave-store/north.mwj-wal"
        self.wait_for(lambda: journal.exists() and journal.stat().st_size > 60000, "the edge keeps nothing")
        for process in running:
            self.assertIsNone(process.poll())
            self.stop(process)
        self.assertFalse((self.folder / "live").exists(), "a stop is no end of the deployment")
        for process in start():
            self.end(process)
        self.assert_same_map("live", "run")

    def test_a_configuration_is_read_again_where_nothing_has_to_start_again(self):
        self.simulate()
        text = (self.folder / "logs/run.yaml").read_text() + f"live: {{broker: \"{self.start_broker()}\", speed: 8, preview_period_s: "
        configuration = self.folder / "logs/run.yaml"
        configuration.write_text(text + "3600}\n")
        start = lambda role, *rest: self.start("serve", role, "logs/run.yaml", *rest, has_terminal=False)
        programs = {"cloud": start("cloud", "--out", "live"),
                    "north": start("edge", "--name", "north"),
                    "south": start("edge", "--name", "south"),
                    "alpha": start("robot", "--name", "alpha", "--set", "live.speed=1")}
        journal = self.folder / "mapweave-store/north.mwj-wal"
        self.wait_for(lambda: journal.exists() and journal.stat().st_size > 40000, "the edge keeps nothing")
        reload = lambda name: programs[name].send_signal(signal.SIGHUP)
        port = free_port()
        configuration.write_text(text + f"0.2, page_port: {port}, store: elsewhere}}\n")
        reload("north")
        self.wait_for(lambda: self.shown_maps(port) > 0, "the page that came later shows the maps")
        configuration.write_text(text + "an apple a day}\n")
        reload("north")
        time.sleep(support.PATIENCE)   # it looks every 50 ms
        configuration.write_text(text + "0.2, robot_buffer_kb: 4096}\n")
        for name in ("alpha", "south", "cloud"):
            reload(name)
        time.sleep(1)
        self.assertEqual(ask(port, "/healthz")[0], 200, "a file that cannot be read changes nothing")
        self.assertTrue(all(process.poll() is None for process in programs.values()))
        programs["alpha"].send_signal(signal.SIGINT)
        configuration.write_text(text + "0.2}\n")
        for name in ("beta", "gamma"):
            programs[name] = start("robot", "--name", name)
        said = {name: process.communicate(timeout=120 * support.PATIENCE)[1] for name, process in programs.items()}
        for name, process in programs.items():
            self.assertIn(process.returncode, (support.DONE, support.APART), said[name])   # alpha has seen little
        self.assertIn("read again; changed: live.preview_period_s, live.page_port", said["north"])
        self.assertIn("when the program is started again: live.store", said["north"])
        self.assertIn("the configuration was not read again, and everything stays as it was", said["north"])
        self.assertIn("preview_period_s", said["north"].split("stays as it was")[1])
        self.assertIn("changed: live.preview_period_s, live.robot_buffer_kb", said["alpha"])
        self.assertIn("the cloud's preview: ", said["cloud"], "an hour was to pass before")

    def shown_maps(self, port):
        shown = ask(port, "/maps.json")[1]
        return len(json.loads(shown)["maps"]) if shown else 0

    def test_a_service_manager_learns_when_an_edge_is_ready_works_and_stops(self):
        self.simulate()
        talk = ["--name", "north", "--set", f"live.broker={self.start_broker()}"]
        for address in (str(self.folder / "notify"), f"\0{self.folder}/notify"):
            with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
                manager.bind(address)
                manager.settimeout(30 * support.PATIENCE)
                edge = self.start("serve", "edge", "logs/run.yaml", *talk, NOTIFY_SOCKET=address.replace("\0", "@"), WATCHDOG_USEC="300000")
                self.assertEqual(manager.recv(4096), b"READY=1")
                began, came = time.monotonic(), []
                while came.count(b"WATCHDOG=1") < 5:
                    came.append(manager.recv(4096))
                self.assertGreater(time.monotonic() - began, 0.3, "five times, every 0.1 s")
                self.assertIn(b"STATUS=0 of 2 robots connected, 0 scans mapped", came)
                self.stop(edge)
                manager.setblocking(False)
                while (last := manager.recv(4096)) == b"WATCHDOG=1":
                    pass
                self.assertEqual(last, b"STOPPING=1")

    def test_the_watchdog_of_another_program_is_left_alone(self):
        self.simulate()
        with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
            manager.bind(str(self.folder / "notify"))
            manager.settimeout(10 * support.PATIENCE)
            talk = ["--name", "north", "--set", f"live.broker={self.start_broker()}"]
            edge = self.start("serve", "edge", "logs/run.yaml", *talk, NOTIFY_SOCKET=str(self.folder / "notify"), WATCHDOG_USEC="100000", WATCHDOG_PID="1")
            self.assertEqual(manager.recv(4096), b"READY=1")
            self.assertTrue(manager.recv(4096).startswith(b"STATUS="))
            manager.settimeout(1)
            with self.assertRaises(TimeoutError, msg="the watchdog is another program's"):
                manager.recv(4096)
            self.stop(edge)

    def test_what_is_wrong_is_said_at_the_start(self):
        self.simulate()
        nowhere = ["--set", f"live.broker=nats://127.0.0.1:{free_port()}"]
        done = self.mapweave("serve", "robot", "logs/run.yaml", code=support.USAGE)
        self.assert_says(done, "which robot", "alpha, beta, gamma")
        done = self.mapweave("serve", "edge", "logs/run.yaml", "--name", "nort", code=support.USAGE)
        self.assert_says(done, "no edge 'nort'", "did you mean 'north'")
        done = self.mapweave("serve", "edge", "logs/run.yaml", "--name", "north", "--set", "mode=cloud-only", code=support.BAD_INPUT)
        self.assert_says(done, "mode: offload")
        self.assert_says(self.mapweave("doctor", "logs/run.yaml", *nowhere, code=support.UNANSWERED), "cannot be reached")
        self.assertIn("nothing is wrong", self.mapweave("doctor").stdout)
        done = self.mapweave("serve", "edge", "logs/run.yaml", "--name", "north", "--set", "live.broker=ros", code=support.BAD_INPUT)
        self.assert_says(done, "only nodes of ROS", "mapweave_ros")
        done = self.mapweave("serve", "robot", "logs/run.yaml", "--name", "alpha", *nowhere, code=support.UNANSWERED)
        self.assert_says(done, nowhere[1].split("=")[1].removeprefix("nats://"))


if __name__ == "__main__":
    support.main()
