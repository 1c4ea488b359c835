"""A deployment on this machine, as users start it: a broker, a cloud, edges and robots; what they say of themselves, and what they use."""
import http.client
import json
import math
import os
import pathlib
import re
import shutil
import signal
import socket
import subprocess
import threading
import time
import urllib.request

from benches import common
from benches.ros import free_port
from benches.serve_bench.relay import Relay

BROKER = shutil.which("nats-server") or shutil.which("nats-server", path="/usr/sbin:/usr/local/bin")
TICKS = os.sysconf("SC_CLK_TCK")
MB = 1e6
NO_ANSWER = (OSError, ValueError, http.client.HTTPException)


def environment():
    return {key: value for key, value in os.environ.items() if not key.startswith("MAPWEAVE_")}


def answer(port, path):
    with urllib.request.urlopen(f"http://127.0.0.1:{port}{path}", timeout=10) as got:
        return json.load(got)


class Process:
    """What is started again after it was killed. Processor time and peak are of all its lives."""

    def __init__(self, name, command, folder):
        self.name, self.command, self.folder = name, list(map(str, command)), folder
        self.process, self.cpu_before_s, self.cpu_now_s, self.resident_mb, self.peak_mb = None, 0.0, 0.0, 0.0, 0.0

    def start(self):
        with (self.folder / f"{self.name}.log").open("a") as log:
            self.process = subprocess.Popen(self.command, cwd=self.folder, env=environment(), stdout=log, stderr=log)

    @property
    def is_running(self):
        return self.process is not None and self.process.poll() is None

    @property
    def cpu_s(self):
        return self.cpu_before_s + self.cpu_now_s

    def kill(self):
        if self.is_running:
            self.look()
            self.process.kill()
        if self.process is not None:
            self.process.wait()
        self.cpu_before_s, self.cpu_now_s = self.cpu_s, 0.0

    def send(self, number):
        self.process.send_signal(number)

    def look(self):
        """What it uses now; what it used last where it has ended."""
        try:
            at = pathlib.Path(f"/proc/{self.process.pid}")
            words = (at / "stat").read_text().rpartition(")")[2].split()
            held = dict(re.findall(r"^(VmRSS|VmHWM):\s*(\d+) kB", (at / "status").read_text(), re.MULTILINE))
        except (AttributeError, OSError):
            return
        if held:   # else it has ended, and nobody has asked for its code yet
            self.cpu_now_s = (int(words[11]) + int(words[12])) / TICKS
            self.resident_mb = int(held["VmRSS"]) * 1024 / MB
            self.peak_mb = max(self.peak_mb, int(held["VmHWM"]) * 1024 / MB)

    def ports(self):
        """Local ports of its connections."""
        try:
            at = pathlib.Path(f"/proc/{self.process.pid}")
            sockets = {os.readlink(file) for file in (at / "fd").iterdir()}
            lines = [line.split() for line in (at / "net/tcp").read_text().splitlines()[1:]]
        except (AttributeError, OSError):
            return set()
        return {int(words[1].split(":")[1], 16) for words in lines if f"socket:[{words[9]}]" in sockets}


class Board(threading.Thread):
    """What all programs say of themselves every 2 s, as the broker passes it on; it comes back when the broker does."""

    def __init__(self, port):
        super().__init__(daemon=True)
        self.port, self.words, self.ends = port, [], False   # words: (user, status)

    def run(self):
        while not self.ends:
            try:
                self.listen()
            except NO_ANSWER:
                pass
            time.sleep(0.1)

    def listen(self):
        with socket.create_connection(("127.0.0.1", self.port), timeout=5) as wire, wire.makefile("rb") as lines:
            wire.sendall(b'CONNECT {"verbose": false}\r\nSUB mw.status.* 1\r\n')
            while line := lines.readline():
                if line.startswith(b"PING"):
                    wire.sendall(b"PONG\r\n")
                elif line.startswith(b"MSG "):
                    _, subject, *_, size = line.decode().split()
                    self.words.append((subject.rpartition(".")[2], json.loads(lines.read(int(size) + 2))))

    def of(self, user):
        return [status for name, status in list(self.words) if name == user]


class Watch(threading.Thread):
    """Looks at the pages of edges and the cloud: when each robot's newest scan in the preview became another, and the last status."""

    def __init__(self, ports, period_s):
        super().__init__(daemon=True)
        self.ports, self.period_s, self.ends = ports, period_s, False
        self.shown = {tier: {} for tier in ports}   # {tier: {robot: [(clock, stamp)]}}
        self.last = {}

    def run(self):
        while not self.ends:
            begin = time.time()
            for tier, port in self.ports.items():
                try:
                    status = answer(port, "/status.json")["tiers"][0]
                except NO_ANSWER:
                    continue
                self.last[tier] = status
                for robot, stamp in status["newest_scan_s"].items():
                    seen = self.shown[tier].setdefault(robot, [])
                    if not seen or seen[-1][1] != stamp:
                        seen.append((time.time(), stamp))
            time.sleep(max(0.0, begin + self.period_s - time.time()))

    def newest(self, tier):
        return {robot: seen[-1][1] for robot, seen in self.shown[tier].items()}

    def between_previews_s(self, tier):
        """Of the last two that showed something new."""
        times = sorted({round(clock, 1) for seen in self.shown[tier].values() for clock, _ in seen})
        return times[-1] - times[-2] if len(times) > 1 else math.nan

    def links(self, tier):
        """{robot: counts} of an edge."""
        return {link["name"]: link["counts"] for link in self.last.get(tier, {"links": []})["links"] if link["role"] == "robot"}


class Usage(threading.Thread):
    """What programs use, again and again, and what went over their connections."""

    def __init__(self, processes, monitor, period_s=0.25):
        super().__init__(daemon=True)
        self.processes, self.monitor, self.period_s, self.ends = processes, monitor, period_s, False
        self.sent, self.received = {}, {}   # bytes by name of a program

    def run(self):
        next_wires = 0.0
        while not self.ends:
            for process in self.processes:
                process.look()
            if time.time() >= next_wires:
                self.look_at_wires()
                next_wires = time.time() + 1.0
            time.sleep(self.period_s)

    def look_at_wires(self):
        try:
            wires = {wire["port"]: wire for wire in answer(self.monitor, "/connz?limit=1000")["connections"]}
        except NO_ANSWER:
            return
        for process in self.processes:
            own = [wires[port] for port in process.ports() if port in wires]
            if own:
                self.sent[process.name] = sum(wire["in_bytes"] for wire in own)
                self.received[process.name] = sum(wire["out_bytes"] for wire in own)


class Deployment:
    """robots: {name: edge}. Everything is started by its name, in any order, and ended at the end of `with`."""

    def __init__(self, folder, configuration, robots, options, watch_s=0.1, wire=None, has_coordinator=False):
        """wire: of robots to the broker, as Relay has it; None: none between them."""
        shutil.rmtree(folder / "live", ignore_errors=True)
        self.folder, self.robots, self.edges = folder / "live", robots, sorted(set(robots.values()))
        self.folder.mkdir(parents=True)
        port, monitor = free_port(), free_port()
        self.pages = {tier: free_port() for tier in (*self.edges, "cloud")}
        self.plan = self.folder / "plans/plan.json"
        wire_port = free_port()
        self.relay = Relay(wire_port, port, **wire) if wire is not None else None

        def serve(role, name, *arguments):
            broker = wire_port if self.relay and role == "robot" else port
            talk = [word for key, value in {"broker": f"nats://127.0.0.1:{broker}", **options}.items() for word in ("--set", f"live.{key}={value}")]
            page = ["--set", f"live.page_port={self.pages[name]}"] if name in self.pages else []
            return Process(name, [common.PROGRAM, "serve", role, configuration, *arguments, *talk, *page], self.folder)
        self.broker = Process("broker", [BROKER, "-js", "-a", "127.0.0.1", "-p", port, "-m", monitor, "-sd", self.folder / "streams"], self.folder)
        self.programs = {"cloud": serve("cloud", "cloud", "--out", self.folder / "maps"), **{edge: serve("edge", edge, "--name", edge) for edge in self.edges},
                         **{robot: serve("robot", robot, "--name", robot) for robot in robots}}
        if has_coordinator:
            self.programs["coordinator"] = serve("coordinator", "coordinator", "--out", self.plan.parent)
        self.all = {"broker": self.broker, **self.programs}
        self.board, self.watch, self.usage = Board(port), Watch(self.pages, watch_s), Usage(list(self.all.values()), monitor)
        self.began = None

    def __enter__(self):
        self.broker.start()
        time.sleep(1.0)
        for thread in (self.board, self.watch, self.usage):
            thread.start()
        for name in ("cloud", *self.edges):
            self.programs[name].start()
        self.wait_for(lambda: len(self.watch.last) == len(self.pages), 60, "not all pages are there")
        for robot in self.robots:
            self.programs[robot].start()
        if "coordinator" in self.programs:
            self.programs["coordinator"].start()
        self.began = time.time()
        return self

    def __exit__(self, *_):
        for thread in (self.watch, self.usage, self.board):
            thread.ends = True
        for process in reversed(self.all.values()):
            if process.is_running:
                process.send(signal.SIGCONT)
            process.kill()
        if self.relay:
            self.relay.close()
        shutil.rmtree(self.folder / "streams", ignore_errors=True)

    def fail(self, what):
        common.give_up(f"{what}; see {self.folder}/*.log")

    def expect_sound(self):
        """Nobody may end by itself but with its work done."""
        for name, process in self.all.items():
            code = process.process.poll() if process.process else None
            if code is not None and not (code == 0 and name != "broker") and not (code == 4 and name == "cloud") and code != -signal.SIGKILL:
                self.fail(f"{name} ended by itself with exit code {code}")

    def wait_for(self, condition, seconds, what):
        end = time.time() + seconds
        while not condition():
            self.expect_sound()
            if time.time() > end:
                self.fail(what)
            time.sleep(0.05)

    def wait_for_drives(self, seconds):
        self.wait_for(lambda: not any(self.programs[robot].is_running for robot in self.robots), seconds, f"robots still drive after {seconds:.0f} s")

    def wait_for_results(self, seconds):
        self.wait_for(lambda: not any(process.is_running for process in self.programs.values()), seconds, f"the map is not there after {seconds:.0f} s")
        return self.folder / "maps"

    def begun(self, robot, speed):
        """Clock time at which a robot read its first record, as it says itself: to within what passes between two of its records."""
        times = [status["said_at_ns"] * 1e-9 - tier["counts"]["recorded_seconds"] / speed
                 for status in self.board.of(f"robot-{robot}") for tier in status["tiers"] if tier["state"] == "driving" and tier["counts"]["messages"] > 0]
        return min(times) if times else None

    def lost_scans(self):
        return sum(counts.get("lost_scans", 0) for edge in self.edges for counts in self.watch.links(edge).values())

    def stored_mb(self):
        """{journals, streams}: what lies on the disk now."""
        def of(folder):
            sizes = 0
            for path in folder.rglob("*"):
                try:
                    sizes += path.stat().st_size if path.is_file() else 0
                except OSError:   # it was removed meanwhile
                    pass
            return sizes / MB
        return {"journals": of(self.folder / "mapweave-store"), "broker's streams": of(self.folder / "streams")}
