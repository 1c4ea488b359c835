"""What the scripted sessions of users share: looking at results, the relative error as evo computes it, a simulated flat."""
import json
import math
import pathlib
import re
import shutil
import subprocess
import tempfile

import support
from strict_readers import read_tum
from support import DONE

# Two robots with a laser and a small depth camera in one flat.
FLAT = """seed: 7
buildings: [{kind: apartment, furniture: {round: 0.3}, apartment: {width_m: 8, height_m: 7}}]
cameras: [{id: rgbd, kind: rgbd, width: 160, height: 120, fx: 131, fy: 131, frames_per_second: 10}]
robots: [{id: alpha, length_m: 4, first_room: 0, last_room: 1, edge: edge0}, {id: beta, length_m: 4, first_room: 0, last_room: 1, edge: edge0}]
"""


# --- poses as matrices, and the relative error as evo computes it ------------------------------------------------------

def matrix(row):
    """Rotation as nine numbers, and translation, of a line of a TUM file."""
    _, x, y, z, *quaternion = row
    a, b, c, w = (value / math.hypot(*quaternion) for value in quaternion)   # the data set's have four digits
    return ((1 - 2 * (b * b + c * c), 2 * (a * b - c * w), 2 * (a * c + b * w), 2 * (a * b + c * w), 1 - 2 * (a * a + c * c), 2 * (b * c - a * w),
             2 * (a * c - b * w), 2 * (b * c + a * w), 1 - 2 * (a * a + b * b)), (x, y, z))


def between(one, other):
    """Where the second pose is as the first one sees it: inverse(one) * other."""
    (r, t), (q, u) = one, other
    step = [u[i] - t[i] for i in range(3)]
    return (tuple(sum(r[3 * k + i] * q[3 * k + j] for k in range(3)) for i in range(3) for j in range(3)),
            tuple(sum(r[3 * k + i] * step[k] for k in range(3)) for i in range(3)))


def associated(estimate, reference, most_s=0.01):
    """As evo's matching_time_indices(): for each pose of the shorter file the nearest of the other one."""
    shorter, longer = sorted((estimate, reference), key=len)
    pairs = [(one, min(longer, key=lambda row: abs(row[0] - one[0]))) for one in shorter]
    pairs = [pair for pair in pairs if abs(pair[0][0] - pair[1][0]) <= most_s]
    return pairs if shorter is estimate else [(one, other) for other, one in pairs]


def relative_errors(estimate, reference):
    """(RMSE in metres, RMSE in degrees) of evo_rpe --delta 1 --delta_unit f, unaligned."""
    pairs = [(matrix(one), matrix(other)) for one, other in associated(estimate, reference)]
    moved, turned = [], []
    for (e, r), (f, s) in zip(pairs, pairs[1:]):
        rotation, translation = between(between(r, s), between(e, f))
        moved.append(math.hypot(*translation))
        turned.append(math.degrees(math.acos(max(-1.0, min(1.0, (rotation[0] + rotation[4] + rotation[8] - 1) / 2)))))
    return tuple(math.sqrt(sum(value * value for value in values) / len(values)) for values in (moved, turned))


def evos_errors(reference, estimate):
    """The same by evo itself."""
    found = []
    for part in ("trans_part", "angle_deg"):
        said = subprocess.run(["evo_rpe", "tum", reference, estimate, "-r", part, "--delta", "1", "--delta_unit", "f"], text=True, capture_output=True, check=True)
        found.append(float(re.search(r"rmse\s+(\S+)", said.stdout).group(1)))
    return found


class Session(support.Scenario):
    def json_of(self, *arguments, **how):
        return json.loads(self.mapweave(*arguments, "--json", **how).stdout)

    def write_log(self, name, lines):
        return self.write(name, "\n".join(lines) + "\n").name

    def poses(self, path):
        return len(read_tum(self.folder / path))

    def robots_in(self, results):
        """The robots of all teams, by team folder; none may be in two."""
        found = {team.name: sorted(path.stem for path in (team / "trajectories").glob("*.tum")) for team in sorted((self.folder / results).glob("team*"))}
        names = [name for team in found.values() for name in team]
        self.assertEqual(len(names), len(set(names)), found)
        return found

    def assert_whole(self, results):
        """Everything that the manifest lists is there, as it was written."""
        files = self.json_of("inspect", results)["files"]
        self.assertEqual((files["changed"], files["missing"]), ([], []))
        self.assertGreater(files["unchanged"], 3)


class OfAFlat(Session):
    """Users of one simulated flat, which is made once."""

    @classmethod
    def setUpClass(cls):
        cls.base = pathlib.Path(tempfile.mkdtemp(prefix="mapweave-scenario-"))
        cls.addClassCleanup(shutil.rmtree, cls.base, ignore_errors=True)
        (cls.base / "flat.yaml").write_text(FLAT)
        for command in cls.STEPS:
            said = subprocess.run([support.PROGRAM, *command], cwd=cls.base, env=support.environment(), text=True, capture_output=True, check=False)
            assert said.returncode == DONE, said.stderr
            cls.said = said.stdout

    def setUp(self):
        super().setUp()
        for path in self.base.iterdir():
            (self.folder / path.name).symlink_to(path)
