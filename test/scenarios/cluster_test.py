"""run --cluster: robots of a run mapped by workers, programs of their own; the results are those of one process."""
import re
import shutil
import signal
import subprocess

import serve_test
import support

ROBOTS = ("alpha", "beta", "gamma")

CAMERAS = """
seed: 7
buildings:
  - {kind: apartment, furniture: {round: 0.3}, apartment: {width_m: 8, height_m: 7}}
cameras:
  - {id: rgbd, kind: rgbd, width: 320, height: 240, fx: 262, fy: 262, frames_per_second: 10}
robots:
  - {id: alpha, length_m: 5}
  - {id: beta, length_m: 5}
"""


class Cluster(serve_test.WithBroker):
    def setUp(self):
        super().setUp()
        self.simulate()
        self.mapweave("run", "logs/run.yaml", "--out", "run")
        self.broker = self.start_broker()

    def start_writing(self, name, *arguments):
        """What it says is in NAME.txt, as it comes."""
        said = (self.folder / f"{name}.txt").open("w")
        self.addCleanup(said.close)
        process = subprocess.Popen([support.PROGRAM, *map(str, arguments)], cwd=self.folder, env=support.environment(), stdout=said, stderr=said)
        self.addCleanup(process.wait)
        self.addCleanup(process.kill)
        return process

    def said(self, name):
        return (self.folder / f"{name}.txt").read_text()

    def start_worker(self, name, *arguments):
        return self.start_writing(name, "worker", "--cluster", self.broker, "--name", name, *arguments)

    def start_run(self):
        return self.start_writing("spread-run", "run", "logs/run.yaml", "--cluster", self.broker, "--out", "spread", "--set", "live.patience_s=3")

    def assert_ends(self, process, name, code=support.DONE):
        self.assertEqual(process.wait(150 * support.PATIENCE), code, self.said(name))

    def assert_results_of_one_process(self):
        one, other = self.outputs("spread"), self.outputs("run")
        for papers in (one, other):
            papers.pop("config.yaml")
        self.assertEqual(one, other)
        self.assertEqual(serve_test.without_seconds(self.read_json("spread/merges.json")), serve_test.without_seconds(self.read_json("run/merges.json")))
        self.assertEqual(self.read_json("spread/manifest.json")["inputs"], self.read_json("run/manifest.json")["inputs"])

    def count(self, said, what):
        return int(re.search(rf"(\d+) {what}", said).group(1))

    def stop(self, worker, name):
        worker.send_signal(signal.SIGTERM)
        self.assert_ends(worker, name)
        return self.said(name)

    def test_workers_map_and_the_results_are_those_of_one_process(self):
        workers = [self.start_worker(f"w{i}") for i in range(2)]
        self.assert_ends(self.start_run(), "spread-run")
        for robot in ROBOTS:
            self.assertIn(f"robot {robot}: worker w", self.said("spread-run"))
        self.assert_results_of_one_process()
        said = [self.stop(worker, f"w{i}") for i, worker in enumerate(workers)]
        mapped = [self.count(one, "robots mapped") for one in said]
        self.assertEqual(sum(mapped), len(ROBOTS), said)
        self.assertTrue(all(mapped), f"both work: {mapped}")

    def test_pairs_are_judged_and_dense_maps_made_by_workers(self):
        shutil.rmtree(self.folder / "run")
        logs = self.folder / "logs"
        shutil.rmtree(logs)
        self.mapweave("simulate", self.write("cameras.yaml", CAMERAS), "--out", "logs")
        robots = "".join(f"  - {{id: {name}, log: {name}.rawlog, edge: {edge}, sensor: all}}\n" for name, edge in (("alpha", "west"), ("beta", "east")))
        (logs / "run.yaml").write_text(f"robots:\n{robots}output: {{ply: true, octomap: true, octomaps_of: all}}\n")
        self.mapweave("run", "logs/run.yaml", "--out", "run")
        workers = [self.start_worker(f"w{i}") for i in range(2)]
        self.assert_ends(self.start_run(), "spread-run")
        self.assert_results_of_one_process()
        for name in ("map.ply", "map.dense.pcd", "map.bt", "map.ot"):
            self.assertIn(f"team/{name}", self.outputs("spread"))
        said = [self.stop(worker, f"w{i}") for i, worker in enumerate(workers)]
        self.assertGreater(sum(self.count(one, "tasks judged") for one in said), 0, said)
        self.assertEqual(sum(self.count(one, "dense maps made") for one in said), 5, "of two robots, two edges and the team")

    def test_a_worker_that_dies_costs_its_task_alone(self):
        first = self.start_worker("first")
        run = self.start_run()
        self.wait_for(lambda: "robot alpha: worker first" in self.said("spread-run"), "the worker gets no task")
        first.kill()
        self.wait_for(lambda: "worker first is silent; another one gets its task: robot alpha" in self.said("spread-run"), "nobody misses the worker")
        second = self.start_worker("second")
        self.assert_ends(run, "spread-run")
        self.assert_results_of_one_process()
        self.assertIn("3 robots mapped", self.stop(second, "second"))

    def test_logs_are_found_by_name_and_must_be_those_of_the_run(self):
        there = self.folder / "there"
        there.mkdir()
        for robot in ROBOTS:
            shutil.copy(self.folder / f"logs/{robot}.rawlog", there)
        worker = self.start_worker("elsewhere", "--logs", "there")
        self.assert_ends(self.start_run(), "spread-run")
        self.assert_results_of_one_process()
        shutil.rmtree(self.folder / "spread")
        shutil.copy(there / "beta.rawlog", there / "alpha.rawlog")
        self.assert_ends(self.start_run(), "spread-run", support.BAD_INPUT)
        self.assertIn("the log of robot 'alpha' is another one here", self.said("spread-run"))
        self.assert_nothing_left("spread")
        self.stop(worker, "elsewhere")

    def test_what_cannot_be_spread_is_said(self):
        spread = ["run", "logs/run.yaml", "--out", "spread", "--cluster"]
        for key, value in (("server.share", "view"), ("coordinator.method", "default"), ("cloud.rounds.period_s", "5")):
            done = self.mapweave(*spread, self.broker, "--set", f"{key}={value}", code=support.BAD_INPUT)
            self.assert_says(done, key.rsplit(".", 1)[0] if key.startswith("cloud") else key, "without --cluster")
        done = self.mapweave(*spread, "nats://127.0.0.1:1", code=support.UNANSWERED)
        self.assert_says(done, "127.0.0.1:1")
        self.assert_says(self.mapweave("worker", "--cluster", "nats://192.0.2.1:4222", code=support.BAD_INPUT), "no keys")
        self.assert_nothing_left("spread")


if __name__ == "__main__":
    support.main()
