"""One input, one result: whatever the number of threads, the order of the robots, the time of day."""
import hashlib
import json
import pathlib
import re

import support
from support import APART, DONE


def sealed(folder):
    """Every file's bytes by its name, but for times: those parts of the reports are taken out."""
    files = {}
    for path in sorted(folder.rglob("*")):
        if path.is_file():
            name = str(path.relative_to(folder))
            files[name] = WITHOUT_TIMES.get(name, lambda data: data)(path.read_bytes())
    return files


def without(data, keys):
    if isinstance(data, list):
        return [without(item, keys) for item in data]
    if isinstance(data, dict):
        return {key: without(value, keys) for key, value in data.items() if key not in keys}
    return data


TIMES = {"seconds", "wall_seconds", "cpu_seconds", "real_time_factor", "peak_rss_bytes", "load", "total_seconds", "algorithm_seconds", "came_seconds",
         *(f"{work}_cpu_seconds" for work in ("packing", "mapping", "seeing", "fusing", "repeated", "judging", "planning")),
         *(f"{done}_seconds" for done in ("packed", "arrived", "mapped", "ready", "fused", "judged"))}
PAGE = re.compile(rb'<script type="application/json" id="run">(.*?)</script>', re.DOTALL)
WITHOUT_TIMES = {
    "report.html": lambda data: (PAGE.sub(b"", data), without(json.loads(PAGE.search(data).group(1)), TIMES | {"tracking_mean_ms", "options"})),   # options: robots as they were listed
    "summary.json": lambda data: without(json.loads(data), TIMES),
    "merges.json": lambda data: without(json.loads(data), TIMES),
    "manifest.json": lambda data: without(json.loads(data), {"outputs_with_times"}),
}


class Determinism(support.Scenario):
    def setUp(self):
        super().setUp()
        self.mapweave("split", support.need(support.MALAGA), "--robots", "2", "--out", "logs")
        self.write("room.log", "\n".join(support.room_lines(30)) + "\n")   # elsewhere: it stays apart
        self.robots = [("alpha", "logs/robot0.rawlog", "north"), ("beta", "logs/robot1.rawlog", "north"), ("gamma", "room.log", "south")]

    def run_team(self, name, robots, *flags):
        config = self.configuration(robots)
        self.mapweave("run", config, "--out", name, *flags, code=(DONE, APART))
        return sealed(self.folder / name)

    def assert_same(self, one, other):
        for files in (one, other):
            files.pop("config.yaml", None)   # as options
            files.get("manifest.json", {}).get("outputs", {}).pop("config.yaml", None)
        self.assertEqual(list(one), list(other))
        self.assertEqual([name for name in one if one[name] != other[name]], [])

    def test_coordinators_decide_the_same(self):
        flags = ("--set", "coordinator.method=default", "--set", "coordinator.overlap_period_s=10",
                 "--set", "edges=[{id: north, until_s: 25}, {id: south}]")
        flags += ("--set", "team.frame=alpha")
        first = self.run_team("first", self.robots, "--threads", "1", *flags)
        self.assertGreater(len(first["summary.json"]["coordinator"]["decisions"]), 2)
        self.assert_same(first, self.run_team("second", self.robots[::-1], "--threads", "2", *flags))

    def test_threads_time_and_order_of_robots_change_no_byte(self):
        # Who is listed first gives the frame, unless it is said.
        frame = ("--set", "team.frame=alpha")
        first = self.run_team("first", self.robots, "--threads", "1", *frame)
        self.assertGreater(len(first), 30)
        self.assert_same(first, self.run_team("second", self.robots[::-1], "--threads", "2", *frame))
        manifest = self.read_json("first/manifest.json")
        for name, checksum in {**manifest["outputs"], **manifest["outputs_with_times"]}.items():
            self.assertEqual(hashlib.sha256((self.folder / "first" / name).read_bytes()).hexdigest(), checksum, name)
        for entry in manifest["inputs"]:
            self.assertEqual(hashlib.sha256(pathlib.Path(entry["path"]).read_bytes()).hexdigest(), entry["sha256"])

    def test_the_engines_of_mrpt_answer_alike_to_one_seed(self):
        for engine in ("icp", "rbpf"):
            with self.subTest(engine):
                for run in ("first", "second"):
                    self.mapweave("slam", "logs/robot0.rawlog", "--engine", engine, "--seed", "7", "--out", f"{engine}-{run}")
                self.assert_same(*(sealed(self.folder / f"{engine}-{run}") for run in ("first", "second")))


if __name__ == "__main__":
    support.main()
