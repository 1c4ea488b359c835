"""Stretches of a log as robots of their own, and what each saw of the building: cells of half a metre, by the log's poses as one map."""
import dataclasses
import math
import threading

from benches.team_bench import carmen, inputs, judging

CELL_M, RANGE_M, RAYS = 0.5, 20.0, 45
LOOK_EVERY_M, LOOK_EVERY_RAD = 0.5, 0.5
FEWEST_LOOKS = 5
_lock = threading.Lock()


@dataclasses.dataclass(frozen=True)
class Window:
    log: str
    first_s: float
    end_s: float
    name: str
    mirrored: bool = False
    odometry_seed: int = 1   # of logs that have none

    def key(self):
        return f"windows/{self.log}/{self.first_s:.2f}-{self.end_s:.2f}{'-mirrored' if self.mirrored else ''}-{self.name}"

    def write(self, folder):
        with _lock:
            whole = inputs.text(self.log, self.odometry_seed if self.log in inputs.CORRECTED_LOGS else 0)
        part = carmen.cut(whole, self.first_s, self.end_s)
        folder.mkdir(parents=True, exist_ok=True)
        return [(carmen.mirrored(part) if self.mirrored else part).write(folder / f"{self.name}.log.gz")]

    def map(self, bench):
        """Its map, and the robot's own trajectory."""
        maps, _ = bench.store.made(self.key(), [self.name], self.write)
        return maps[0], judging.Trajectory.read(maps[0].with_suffix(".tum"))


def truth(bench, log):
    """The joint optimum: the log as one robot; of corrected logs the poses they bring."""
    if log in inputs.CORRECTED_LOGS:
        whole = inputs.text(log)
        return judging.Trajectory(whole.stamps, [scan.robot for scan in whole.scans])
    maps, _ = bench.store.maps(inputs.Cut(log, 1))
    return judging.Trajectory.read(maps[0].with_suffix(".tum"))


class Seen:
    """What was seen from where of one log. `metres`: the path up to each scan."""

    def __init__(self, bench, log):
        self.log, self.truth = log, truth(bench, log)
        with _lock:
            scans = inputs.text(log).scans
        self.stamps, self.metres, self._masks, self._cells = [], [], [], {}
        path_m, last, looked = 0.0, None, None
        for scan in scans:
            pose = self.truth.at(scan.stamp)
            if pose is None:
                continue
            path_m += math.dist(pose[:2], last[:2]) if last else 0.0
            self.stamps.append(scan.stamp)
            self.metres.append(path_m)
            last = pose
            if looked is None or math.dist(pose[:2], looked[:2]) >= LOOK_EVERY_M or abs(carmen.wrap(pose[2] - looked[2])) >= LOOK_EVERY_RAD:
                looked = pose
                self._masks.append((scan.stamp, self._mask(scan, carmen.compose(pose, carmen.between(scan.robot, scan.laser)))))

    def _mask(self, scan, laser):
        mask, ranges = 0, scan.ranges
        count = len(ranges)
        for i in range(0, count, max(1, count // RAYS)):
            length = min(float(ranges[i]), RANGE_M)
            angle = laser[2] - math.pi / 2 + math.pi * i / count
            c, s = math.cos(angle) * CELL_M, math.sin(angle) * CELL_M
            for step in range(int(length / CELL_M) + 1):
                cell = math.floor((laser[0] + c * step) / CELL_M), math.floor((laser[1] + s * step) / CELL_M)
                mask |= 1 << self._cells.setdefault(cell, len(self._cells))
        return mask

    def of(self, first_s, end_s):
        mask = 0
        for stamp, some in self._masks:
            if first_s <= stamp < end_s:
                mask |= some
        return mask

    def looks_at_the_same(self, a, b):
        """[(stamp of a, stamp of b)]: for each look of `a` the look of `b` that shares most with it, where that is half of what either saw; where
        none shares so much, the FEWEST_LOOKS that share most."""
        looks = [[look for look in self._masks if window.first_s <= look[0] < window.end_s] for window in (a, b)]
        found = []
        for stamp, mask in looks[0]:
            share, other = max(((overlap(mask, seen), at) for at, seen in looks[1]), default=(0.0, None))
            found.append((share, stamp, other))
        found.sort(key=lambda one: -one[0])
        return [(stamp, other) for i, (share, stamp, other) in enumerate(found) if other is not None and (share >= 0.5 or i < FEWEST_LOOKS)]

    def draw(self, draw, least_m, most_m):
        """A stretch of so many metres somewhere: first and end."""
        length = draw.uniform(least_m, min(most_m, 0.4 * self.metres[-1]))
        start = draw.uniform(0.0, self.metres[-1] - length)
        first = next(stamp for stamp, path_m in zip(self.stamps, self.metres) if path_m >= start)
        end = next((stamp for stamp, path_m in zip(self.stamps, self.metres) if path_m >= start + length), self.stamps[-1] + 1.0)
        return first, end


_seen = {}


def seen(bench, log):
    if log not in _seen:
        _seen[log] = Seen(bench, log)
    return _seen[log]


def overlap(a, b):
    """Of two masks: what both saw, of the smaller."""
    return (a & b).bit_count() / max(1, min(a.bit_count(), b.bit_count()))
