"""A coordinator as a program of its own gives robots to edges, through a broker on this machine: the map is that of a run with these edges."""
import json
import re
import signal
import unittest

import serve_test
import support

WORLD = """\
laser: {rays: 91, scans_per_second: 2.0}
robots:
  - {id: alpha, edge: north, length_m: 24, first_room: 0}
  - {id: beta, edge: north, length_m: 24, first_room: 3}
  - {id: gamma, edge: north, length_m: 24, first_room: 0}
  - {id: delta, edge: north, length_m: 24, first_room: 3}
"""
# Of a machine on which an edge takes long to merge many maps.
MODEL = {"edge_fusion": {"fixed_s": 0, "per_scan_s": 0, "per_scan_pair_s": 1e-3, "per_shared_scan_s": 0}}
ALL = {"alpha", "beta", "gamma", "delta"}


class ServeCoordinator(serve_test.WithBroker):
    def simulate_badly_grouped(self):
        self.mapweave("simulate", self.write("world.yaml", WORLD), "--out", "logs")
        self.write("logs/model.json", json.dumps(MODEL))
        run = self.folder / "logs/run.yaml"
        self.write("logs/live.yaml", run.read_text() + "\nedges: [{id: north}, {id: south}]\n"
                   "coordinator: {method: default, model: model.json, overlap_period_s: 3, hysteresis: 0.5}\n")   # a busy machine makes edges slow

    def groups(self):
        """{edge: robots} of the coordinator's last plan."""
        try:
            return {edge["id"]: set(edge["robots"]) for edge in self.read_json("plans/plan.json")["edges"]}
        except FileNotFoundError:
            return {}

    def start_all(self, *options):
        talk = ["--set", f"live.broker={self.start_broker()}", "--set", "live.preview_period_s=1", *options]
        self.talk = talk
        self.cloud = self.start("serve", "cloud", "logs/live.yaml", "--out", "live", *talk)
        self.edges = {name: self.start("serve", "edge", "logs/live.yaml", "--name", name, *talk) for name in ("north", "south")}
        self.robots = {name: self.start("serve", "robot", "logs/live.yaml", "--name", name, *talk) for name in sorted(ALL)}
        self.coordinator = self.start("serve", "coordinator", "logs/live.yaml", "--out", "plans", *talk)   # it finds all of them there

    def assert_map_of_a_run(self, groups):
        edge_of = {robot: edge for edge, robots in groups.items() for robot in robots}
        text = re.sub(r'id: "(\w+)", log: "([^"]*)", edge: "\w+"', lambda found: f'id: "{found[1]}", log: "{found[2]}", edge: "{edge_of[found[1]]}"',
                      (self.folder / "logs/run.yaml").read_text())
        self.write("logs/as_planned.yaml", text)
        self.mapweave("run", "logs/as_planned.yaml", "--out", "run", code=(support.DONE, support.APART))
        self.assert_same_map("live", "run")
        self.assertEqual({robot["id"]: robot["edge"] for robot in self.read_json("live/summary.json")["robots"]}, edge_of)

    def end_all(self):
        self.assertIn(self.cloud.wait(200 * support.PATIENCE), (support.DONE, support.APART))
        said = {name: self.end(robot)[1] for name, robot in self.robots.items()}
        self.end(self.coordinator)
        return said

    def test_a_bad_start_is_corrected_by_what_robots_share(self):
        self.simulate_badly_grouped()
        self.start_all("--set", "live.speed=1.5")
        self.wait_for(lambda: len(self.groups().get("south", ())) == 2, "nobody moves", 120)
        doctor = self.mapweave("doctor", "logs/live.yaml", *self.talk[:2], code=(support.DONE, support.GATE_FAILED)).stdout
        self.assertIn("coordinator: said something", doctor)
        self.assertRegex(doctor, r"edge south: \w+ \w+")
        said = self.end_all()
        for edge in self.edges.values():
            self.end(edge)
        groups = self.groups()
        self.assertEqual(sorted(map(sorted, groups.values())), [["alpha", "gamma"], ["beta", "delta"]], "those that share are together")
        for robot in groups["south"]:
            self.assertIn("leaves edge north; it goes to edge south", said[robot])
        self.assert_map_of_a_run(groups)
        plan = self.read_json("plans/plan.json")
        self.assertTrue(plan["final"] and plan["done"])
        self.assertTrue(any(decision["moves"] for decision in plan["decisions"]))
        self.assertTrue(any(edge["speed_is"] == "measured" for edge in plan["edges"]), plan["edges"])
        again = self.mapweave("doctor", "logs/live.yaml", *self.talk[:2])
        self.assertIn("nothing is wrong", again.stdout)

    def test_the_robots_of_a_killed_edge_go_to_the_other_one(self):
        self.simulate_badly_grouped()
        self.start_all("--set", "live.speed=1.5", "--set", "live.lost_after_s=6")
        self.wait_for(lambda: len(self.groups().get("south", ())) == 2, "nobody moves", 120)
        self.edges["south"].send_signal(signal.SIGKILL)
        self.edges["south"].wait()
        self.coordinator.send_signal(signal.SIGKILL)   # another one goes on with its plan
        self.coordinator.wait()
        self.coordinator = self.start("serve", "coordinator", "logs/live.yaml", "--out", "plans", *self.talk)
        self.wait_for(lambda: self.groups().get("north") == ALL, "its robots stay with the dead", 120)
        self.end_all()
        self.end(self.edges["north"])
        self.assert_map_of_a_run({"north": ALL})

    def test_what_is_missing_or_wrong_is_said(self):
        self.simulate_badly_grouped()
        talk = ["--set", f"live.broker={self.start_broker()}"]
        done = self.mapweave("serve", "coordinator", "logs/run.yaml", "--out", "plans", *talk, code=support.BAD_INPUT)
        self.assert_says(done, "has no coordinator", "coordinator: {method: default}")
        done = self.mapweave("doctor", "logs/live.yaml", *talk, code=support.GATE_FAILED)
        self.assertIn("coordinator: it never said anything", done.stdout)
        self.assertIn("mapweave serve coordinator CONFIG --out DIR", done.stdout)
        port = serve_test.free_port()
        first = self.start("serve", "coordinator", "logs/live.yaml", "--out", "plans", *talk, "--set", "live.patience_s=0.5", "--set", f"live.page_port={port}")
        self.wait_for(lambda: "nobody that is needed" in serve_test.findings(port), "it misses nobody")
        status = json.loads(serve_test.ask(port, "/status.json")[1])
        self.assertEqual(status["tiers"][0]["state"], "waiting for robots")
        self.assertIn("mapweave serve coordinator", serve_test.ask(port, "/")[1])
        robot = self.start("serve", "robot", "logs/live.yaml", "--name", "alpha", *talk)
        self.wait_for(lambda: self.groups().get("north") == {"alpha"}, "the robot does not count")
        metrics = serve_test.ask(port, "/metrics")[1]
        self.assertRegex(metrics, r'(?m)^mapweave_plan\{role="coordinator",tier="coordinator"\} 1$')
        guide = (support.ROOT / "apps/mapweave/guide/live.md").read_text()
        self.assertEqual([name for name in re.findall(r"(?m)^# TYPE (\S+)", metrics) if f"`{name}`" not in guide], [])
        first.send_signal(signal.SIGINT)
        self.assertIn("goes on with its plan", first.communicate(timeout=60 * support.PATIENCE)[1])
        robot.send_signal(signal.SIGTERM)
        robot.communicate(timeout=60 * support.PATIENCE)


if __name__ == "__main__":
    support.main()
