"""What the end-to-end tests share: running the program, looking at what it left, and making small logs.

Each *_test.py runs alone:  MAPWEAVE_PROGRAM=build/release/bin/mapweave python3 test/scenarios/cli_test.py
"""
import gzip
import json
import math
import os
import pathlib
import shutil
import struct
import subprocess
import sys
import tempfile
import unittest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = pathlib.Path(os.environ.get("MAPWEAVE_PROGRAM", ROOT / "build/release/bin/mapweave")).resolve()
# Under sanitizers everything takes several times as long.
PATIENCE = float(os.environ.get("MAPWEAVE_PATIENCE", "1"))
MALAGA = pathlib.Path("/usr/share/mrpt/datasets/2006-01ENE-21-SENA_Telecom Faculty_one_loop_only.rawlog")
SIMULATED_BUILDING = pathlib.Path("/usr/share/mrpt/datasets/graphslam-engine-demos/action_observations_map/simul.rawlog")

VERBS = ("run", "serve", "worker", "doctor", "slam", "merge", "split", "convert", "simulate", "inspect", "export", "evaluate", "explain", "report", "plan", "profile", "timeline", "vocabulary", "config")

# Exit codes: README, verbs.
DONE, CANNOT_WRITE, USAGE, BAD_INPUT, APART, GATE_FAILED, UNANSWERED, INTERRUPTED = 0, 1, 2, 3, 4, 5, 6, 130


def environment():
    kept = {key: value for key, value in os.environ.items() if not key.startswith("MAPWEAVE_")}
    kept.pop("DISPLAY", None)  # nothing needs a screen
    kept["LC_ALL"] = "C.UTF-8"
    return kept


def is_sanitized():
    """Whether the program was built with a sanitizer."""
    return any(name in pathlib.Path(PROGRAM).read_bytes() for name in (b"__asan_init", b"__tsan_init"))


class Scenario(unittest.TestCase):
    """A test with a folder of its own, removed at its end."""

    def setUp(self):
        self.folder = pathlib.Path(tempfile.mkdtemp(prefix="mapweave-scenario-"))
        self.addCleanup(shutil.rmtree, self.folder, ignore_errors=True)

    def mapweave(self, *arguments, code=DONE, seconds=120):
        """Runs the program in the test's folder; fails unless it ends with `code` (one, or a tuple of them)."""
        done = subprocess.run([PROGRAM, *map(str, arguments)], cwd=self.folder, env=environment(), text=True, errors="replace",
                              capture_output=True, timeout=seconds * PATIENCE, check=False)
        allowed = code if isinstance(code, tuple) else (code,)
        self.assertIn(done.returncode, allowed, f"mapweave {' '.join(map(str, arguments))}\n{done.stdout}\n{done.stderr}")
        return done

    def start(self, *arguments, has_terminal=True, **variables):
        """Runs the program beside the test, with more variables in its environment; without the test's terminal, if it has one, as a service."""
        process = subprocess.Popen([PROGRAM, *map(str, arguments)], cwd=self.folder, env=environment() | variables, text=True, errors="replace",
                                   stdout=subprocess.PIPE, stderr=subprocess.PIPE, start_new_session=not has_terminal)
        self.addCleanup(lambda: process.poll() is None and process.kill())
        return process

    def assert_says(self, done, *words):
        """The message stands on stderr and holds every word, whatever the case."""
        for word in words:
            self.assertIn(str(word).lower(), done.stderr.lower())
        for crash in ("terminate called", "core dumped", "Segmentation", "AddressSanitizer", "internal error"):
            self.assertNotIn(crash, done.stderr)

    def assert_nothing_left(self, *names):
        """None of the named results exists, and no half-written one beside them."""
        for name in names:
            self.assertFalse((self.folder / name).exists(), f"{name} was left behind")
        partial = [path.name for path in self.folder.rglob("*") if ".partial" in path.name]
        self.assertEqual(partial, [], "half-written results were left behind")

    def write(self, name, text):
        path = self.folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
        return path

    def read_json(self, name):
        return json.loads((self.folder / name).read_text())

    def configuration(self, robots, name="team.yaml", laser="{engine: graph}"):
        """robots: (id, log) or (id, log, edge)."""
        lines = ["robots:"]
        for robot in robots:
            edge = f", edge: {robot[2]}" if len(robot) > 2 else ""
            lines.append(f"  - {{id: {robot[0]}, log: {json.dumps(str(robot[1]))}{edge}}}")
        return self.write(name, "\n".join([*lines, f"laser: {laser}", ""]))


def need(path):
    """First line of a test that needs a file of a Debian package."""
    if not path.exists():
        raise unittest.SkipTest(f"needs {path} of the Debian package mrpt-common")
    return path


def ros_interpreter():
    """Of an environment with PyPI's rosbags and mcap, made below build/ where it is missing; the test is skipped where that cannot be done."""
    sys.path.insert(0, str(ROOT / "scripts/evaluation"))
    import ros_packages
    try:
        return ros_packages.interpreter()
    except ros_packages.Missing as problem:
        raise unittest.SkipTest(str(problem)) from None


# --- small logs -------------------------------------------------------------------------------------------------------

def carmen_scan(stamp, ranges, x, y, heading):
    values = " ".join(r if isinstance(r, str) else f"{r:.3f}" for r in ranges)
    pose = f"{x:.6f} {y:.6f} {heading:.6f}"
    return f"FLASER {len(ranges)}{' ' if ranges else ''}{values} {pose} {pose} {stamp:.6f} robot {stamp:.6f}"


def room_ranges(x, y, heading, rays=181):
    """What a laser sees in an empty room of 9 x 6 m with one pillar; rays from -90 to +90 degrees."""
    ranges = []
    for i in range(rays):
        angle = heading + math.pi * (i / (rays - 1) - 0.5)
        c, s = math.cos(angle), math.sin(angle)
        best = min(((9.0 if c > 0 else 0.0) - x) / c if abs(c) > 1e-9 else 1e9, ((6.0 if s > 0 else 0.0) - y) / s if abs(s) > 1e-9 else 1e9)
        along, across = (6.0 - x) * c + (4.0 - y) * s, (4.0 - y) * c - (6.0 - x) * s   # a pillar at (6, 4), radius 0.4
        if along > 0 and abs(across) < 0.4:
            best = min(best, along - math.sqrt(0.16 - across * across))
        ranges.append(best)
    return ranges


def room_lines(scans=40):
    """A CARMEN log of a robot that drives slowly along a room, as a list of lines, one scan every 0.2 s."""
    lines = []
    for i in range(scans):
        x, y, heading = 2.0 + 0.05 * i, 2.0 + 0.02 * i, 0.01 * i
        lines.append(carmen_scan(1000.0 + 0.2 * i, room_ranges(x, y, heading), x, y, heading))
    return lines


def malaga_bytes():
    """The Malaga log, decompressed: sensory frames and actions in turn."""
    return gzip.decompress(need(MALAGA).read_bytes())


def place_of_ranges(data, scan):
    """Where the ranges (361 float32) of the n-th scan of the Malaga log begin."""
    place = -1
    for _ in range(scan + 1):
        place = data.index(b"CObservation2DRangeScan", place + 1)
    return data.index(struct.pack("<I", 361), place) + 4


def main():
    """As unittest.main(), and 77 (ctest: skipped) where every test was skipped."""
    result = unittest.main(verbosity=2, exit=False).result
    if not result.wasSuccessful():
        sys.exit(1)
    sys.exit(77 if result.testsRun > 0 and len(result.skipped) == result.testsRun else 0)
