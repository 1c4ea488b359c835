"""Programs of a deployment that others should not follow, or that have no room: another configuration or version, a name that is there twice,
a stranger who floods, an edge whose store is full. Each is named on the edge's page and by doctor, and the map is that of a run."""
import contextlib
import json
import pathlib
import resource
import signal
import subprocess
import time

import bad_input_broker_test
import serve_test
import support

FLOODED = "parts that came are no messages"
LITTLE = 4096   # bytes, of which no journal keeps a scan


@contextlib.contextmanager
def held(program):
    """The program stands still, and goes on afterwards."""
    program.send_signal(signal.SIGSTOP)
    try:
        yield
    finally:
        program.send_signal(signal.SIGCONT)


class Programs(bad_input_broker_test.OfTwoRobots):
    speed = 4

    def setUp(self):
        super().setUp()
        self.broker = self.start_broker()

    def metric(self, name):
        lines = serve_test.ask(self.port, "/metrics")[1].splitlines()
        return sum(float(line.split()[-1]) for line in lines if line.startswith(f"mapweave_{name}{{"))

    def doctor(self, code=(support.DONE, support.GATE_FAILED)):
        return self.mapweave("doctor", "logs/run.yaml", *self.talk, code=code).stdout

    def stop(self, program):
        program.kill()
        return program.communicate()[1]

    def restart(self, programs, name, *options):
        programs[name] = self.start("serve", "robot", "logs/run.yaml", "--name", name, *self.talk, *options)

    def test_another_configuration_or_version_is_refused(self):
        programs = self.begin(self.broker)
        self.stop(programs["alpha"])
        self.restart(programs, "alpha", "--set", "seed=5")
        self.wait_for(lambda: "refused" in serve_test.findings(self.port), "the edge's page tells of it")
        self.assertGreater(self.metric("refused_total"), 0)
        self.assertIn("another configuration or version", self.doctor())
        self.assertIn("it has another configuration, or is another version of mapweave", self.stop(programs["alpha"]))
        self.restart(programs, "alpha")
        self.end_all(programs)

    def status_of_alpha(self):
        """A stranger at the broker, and under which subject the robot says what of itself."""
        stranger = bad_input_broker_test.Stranger(self.broker)
        self.addCleanup(stranger.close)
        stranger.subscribe("mw.status.robot-alpha")
        subject, payload = next(stranger.messages())
        return stranger, subject, json.loads(payload)

    def test_doctor_names_programs_of_another_version(self):
        programs = self.begin(self.broker)
        stranger, subject, status = self.status_of_alpha()
        with held(programs["alpha"]):   # it says nothing itself
            status["version"] = "0.0.1"
            stranger.publish(subject, json.dumps(status).encode())
            time.sleep(0.5)
            found = self.doctor()
        self.assertIn("it is version 0.0.1, this one is", found)
        self.assertIn("give all programs the same version", found)
        self.end_all(programs)

    def test_doctor_says_whose_words_cannot_be_read(self):
        programs = self.begin(self.broker)
        stranger, subject, status = self.status_of_alpha()
        tier = status["tiers"][0]
        with held(programs["alpha"]):   # it says nothing itself
            for word in (b'{"tiers": [], "said_at_ns": 1e300}', {"findings": [7]}, {"links": [{"name": 5}]}):
                stranger.publish(subject, word if isinstance(word, bytes) else json.dumps({**status, "tiers": [{**tier, **word}]}).encode())
                time.sleep(0.2)
                found = self.doctor()
                self.assertIn("robot-alpha: what it says of itself cannot be read", found, word)
                self.assertIn("edge-north: said something", found, "of the others all is said")
            stranger.publish(subject, json.dumps({**status, "tiers": [{**tier, "state": "\x1b[2Jdriving"}]}).encode())
            time.sleep(0.2)
            found = self.doctor()
            self.assertIn("?[2Jdriving", found, "a terminal shows it as it is")
            self.assertRegex(found, r"edge north: (not )?on the wire")
        self.end_all(programs)

    def test_the_second_robot_of_a_name_is_refused(self):
        programs = self.begin(self.broker)
        self.wait_for(lambda: self.metric("link_taken_total") > 0, "a robot drives")
        self.write("logs/room.log", "\n".join(support.room_lines(30)) + "\n")
        self.write("logs/twin.yaml", (self.folder / "logs/run.yaml").read_text().replace("alpha.rawlog", "room.log"))
        twin = self.start("serve", "robot", "logs/twin.yaml", "--name", "alpha", *self.talk)
        with held(programs["alpha"]):   # it does not end before its twin comes
            self.wait_for(lambda: "refused" in serve_test.findings(self.port), "the edge's page tells of it")
        self.assertIn("robot 'alpha' is here already", self.stop(twin))
        self.end_all(programs)

    def test_a_stranger_who_floods_takes_no_memory_and_changes_nothing(self):
        programs = self.begin(self.broker)
        stranger = bad_input_broker_test.Stranger(self.broker)
        self.addCleanup(stranger.close)
        stranger.subscribe("mw.edge_north_up.>")   # what robots say to the edge
        subject = next(subject for subject, _ in stranger.messages() if "alpha" in subject)
        flood = bad_input_broker_test.Stranger(self.broker)
        self.addCleanup(flood.close)
        with held(programs["beta"]):   # the deployment does not end before the page was read
            with held(programs["alpha"]):
                for number in range(2000):   # 128 MB
                    flood.publish(subject, number.to_bytes(8, "little") * 8192)
                self.wait_for(lambda: FLOODED in serve_test.findings(self.port), "the edge's page tells of them")
            self.end(programs.pop("alpha"))
            self.assertIn(FLOODED, serve_test.findings(self.port))   # though it has other channels by now
        if not support.is_sanitized():   # sanitizers keep what was freed
            peak = pathlib.Path(f"/proc/{programs['north'].pid}/status").read_text().split("VmHWM:")[1].split()[0]
            self.assertLess(int(peak), 300_000, "kB")
        self.end_all(programs)

    def test_an_edge_whose_store_is_full_goes_on_once_there_is_room(self):
        programs = self.begin(self.broker)
        programs["north"].kill()
        programs["north"].communicate()
        serve = [support.PROGRAM, "serve", "edge", "logs/run.yaml", "--name", "north", "--set", f"live.page_port={self.port}", *self.talk]
        # As a disk without room: no file grows, and nobody is killed for it.
        edge = subprocess.Popen(["sh", "-c", 'trap "" XFSZ; exec "$@"', "sh", *serve], cwd=self.folder, env=support.environment(), text=True,
                                stdout=subprocess.PIPE, stderr=subprocess.PIPE)
        self.addCleanup(lambda: edge.poll() is None and edge.kill())
        programs["north"] = edge
        self.wait_for(lambda: serve_test.findings(self.port), "the edge begins")
        journals = sum(path.stat().st_size for path in self.folder.rglob("*.mwj*"))
        resource.prlimit(edge.pid, resource.RLIMIT_FSIZE, (journals + LITTLE, resource.RLIM_INFINITY))
        self.wait_for(lambda: "cannot be written" in serve_test.findings(self.port), "the edge's page tells of it")
        self.assertIn("cannot be written", self.doctor(support.GATE_FAILED))
        self.assertEqual(serve_test.ask(self.port, "/healthz")[0], 503)
        resource.prlimit(edge.pid, resource.RLIMIT_FSIZE, (resource.RLIM_INFINITY, resource.RLIM_INFINITY))
        self.wait_for(lambda: serve_test.ask(self.port, "/healthz")[0] == 200, "it has room again")
        self.end_all(programs)


if __name__ == "__main__":
    support.main()
