"""Every command block of README, and the examples of every help, as they stand there. Those that build or download are named below."""
import gzip
import json
import math
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import tempfile

import ros1_bags
import support
from finding_test import EVERY_HELP
from support import APART, DONE

# They install packages and build, and are what runs this test: only what they say of themselves is tried.
BUILDING = {"scripts/quickstart", "scripts/test"}
# They wait for each other's programs, or for a broker: serve_test and cluster_test run them.
DEPLOYED = {"serve", "worker", "doctor"}
HELPS = [verb for verb in EVERY_HELP if verb[0] not in DEPLOYED]
ROOMS = "robots=[{id: alpha, length_m: 8, first_room: 0, last_room: 1}, {id: beta, length_m: 8, first_room: 0, last_room: 1}]"


def rows_of(path):
    return [[float(value) for value in line.split()] for line in path.read_text().splitlines() if not line.startswith("#")]


def planar(row):
    return row[1], row[2], 2 * math.atan2(row[6], row[7])


def relation(first, second):
    """The line of two poses: where the second one is as the first one sees it."""
    (x, y, heading), (u, v, other) = planar(first), planar(second)
    c, s = math.cos(heading), math.sin(heading)
    ahead, aside = c * (u - x) + s * (v - y), c * (v - y) - s * (u - x)
    return f"{first[0]} {second[0]} {ahead} {aside} 0 0 0 {math.remainder(other - heading, 2 * math.pi)}\n"


class Examples(support.Scenario):
    @classmethod
    def setUpClass(cls):
        cls.world = pathlib.Path(tempfile.mkdtemp(prefix="mapweave-scenario-")) / "world"
        cls.addClassCleanup(shutil.rmtree, cls.world.parent, ignore_errors=True)
        subprocess.run([support.PROGRAM, "simulate", support.ROOT / "configs/worlds/camera_team.yaml", "--set", ROOMS, "--out", cls.world],
                       env=support.environment(), capture_output=True, check=True)

    def setUp(self):
        super().setUp()
        for robot in ("alpha", "beta"):
            for name in (f"{robot}.rawlog", f"{robot}_Images"):
                (self.folder / name).symlink_to(self.world / name)

    def shell(self, text, *more_codes):
        path = f"{self.folder / 'bin'}:{os.environ['PATH']}"
        done = subprocess.run(["bash", "-c", text], cwd=self.folder, env={**support.environment(), "PATH": path}, text=True, errors="replace",
                              capture_output=True, timeout=200 * support.PATIENCE, check=False)
        self.assertIn(done.returncode, (DONE, *more_codes), f"{text}\n{done.stdout}\n{done.stderr}")
        return done

    def program_at(self, name):
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.symlink_to(support.PROGRAM)

    def test_every_command_block_of_the_readme_runs(self):
        readme = (support.ROOT / "README.md").read_text()
        blocks = re.findall(r"^```\n(.*?)^```", readme, re.DOTALL | re.MULTILINE)
        self.assertEqual(len(blocks), 3, "a new block: say here how it is tried")
        building, own_logs, with_ros = blocks
        commands = {line.split("#")[0].strip() for line in building.splitlines()}
        self.assertEqual(commands, BUILDING)
        for script in commands:
            said = subprocess.run([support.ROOT / script, "--help"], text=True, capture_output=True, check=True).stdout
            self.assertIn(script, said)
        self.program_at("build/release/bin/mapweave")
        self.shell("set -e\n" + own_logs)
        for name in ("maps/team/team/map.color.png", "maps/team/report.html", "maps/team/merges.json", "maps/alpha/map.color.png"):
            self.assertTrue((self.folder / name).exists(), name)
        (self.folder / "office.bag").write_bytes(ros1_bags.bag(ros1_bags.drive()))
        self.shell("set -e\n" + with_ros.split("\n\n")[1])   # what precedes needs a ROS master: ros_nodes_test.py
        self.assertTrue((self.folder / "office_map.mcap").exists())

    def examples(self):
        for verb in HELPS:
            text = self.mapweave(*verb, "--help").stdout.split("Example")[1]
            for line in re.findall(r"^  (mapweave .*)$", text, re.MULTILINE):
                yield line

    def make_inputs(self):
        """What the examples name, under the names that they use."""
        self.write("office.yaml", "robots: [{id: alpha, log: alpha.rawlog, edge: north}, {id: beta, log: beta.rawlog, edge: south}]\n")
        (self.folder / "intel.clf.gz").write_bytes(gzip.compress(("\n".join(support.room_lines(40)) + "\n").encode()))
        shutil.copy(support.ROOT / "configs/worlds/apartment.yaml", self.folder / "world.yaml")
        shutil.copy(self.world / "alpha.truth.tum", self.folder / "groundtruth.txt")
        (self.folder / "truth").mkdir()
        for robot in ("alpha", "beta"):
            shutil.copy(self.world / f"{robot}.truth.tum", self.folder / f"truth/{robot}.truth.tum")
            self.mapweave("slam", f"{robot}.rawlog", "--out", f"maps/{robot}")
        for name in ("a", "b", "06"):
            shutil.copytree(self.folder / "maps/alpha", self.folder / "maps" / name)
        self.mapweave("export", "maps/beta/map.mwdb", "--pgm", "--out", "hall")
        shutil.copy(self.folder / "hall/map.pgm", self.folder / "hall.pgm")
        self.write("hall.yaml", (self.folder / "hall/map.yaml").read_text().replace("map.pgm", "hall.pgm"))
        truth = rows_of(self.folder / "groundtruth.txt")
        for name in ("intel", "alpha"):
            self.write(f"{name}.relations", "".join(relation(truth[i], truth[i + 20]) for i in range(10, len(truth) - 30, 10)))
        self.write("06/times.txt", "".join(f"{row[0]:.6f}\n" for row in rows_of(self.folder / "maps/06/trajectory.tum")))
        problem = {"robots": ["r0", "r1"], "overlaps": [["r0", "r1", 0.3]], "edges": [{"id": "e0", "bandwidth_bytes_per_s": 1e6}]}
        self.write("problem.json", json.dumps(problem))

    def test_the_examples_of_every_help_run_as_they_stand(self):
        self.make_inputs()
        self.program_at("bin/mapweave")
        lines = list(self.examples())
        self.assertGreaterEqual(len(lines), len(HELPS))
        # What one leaves another one reads: first what makes logs, maps of teams and words.
        first = ("mapweave convert ", "mapweave run ", "mapweave vocabulary train ")
        for line in sorted(lines, key=lambda line: not line.startswith(first)):
            with self.subTest(line):
                words = shlex.split(line)
                if "--out" in words:
                    made = self.folder / words[words.index("--out") + 1]
                    shutil.rmtree(made, ignore_errors=True)
                    made.unlink(missing_ok=True)
                codes = (APART,) if words[1] in ("run", "merge") else ()
                self.shell(line, *codes)


if __name__ == "__main__":
    support.main()
