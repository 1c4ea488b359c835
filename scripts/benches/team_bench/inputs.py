"""The logs of which teams are cut, and how: a Cut names everything that a robot's map depends on."""
import bisect
import dataclasses
import functools
import math
import random

from benches import common
from benches.team_bench import carmen, judging

# sensor_m: how far ahead of the robot stands the laser, where the relations speak of it.
BENCHMARK_LOGS = {"intel": 0.0, "fr079": 0.04, "mit-killian": 0.0, "fr-clinic": 0.0}
# Scans with corrected poses, without odometry: ours is made of the poses (carmen.with_odometry), and so are relations. For nothing but tests.
CORRECTED_LOGS = ("freiburg-101", "fhw", "edmonton", "acapulco")
VISITS = ("exp1", "exp2", "exp3")
LASER = common.DATA / "laser"
FEWEST_SCANS = 10
LEAST_PART = 0.4          # of an equal part, the shortest one of a random cut
NEAR_M, FACING_RAD = 3.0, math.radians(60)   # relations of corrected logs: scans that saw the same
MOST_PER_PAIR = 300


def text_of(log):
    if log in BENCHMARK_LOGS:
        return LASER / f"{log}/{log}.clf.gz"
    if log in VISITS:
        return LASER / f"tinyslam/{log}.log.gz"
    return LASER / f"corrected/{log}-corrected.log.gz"


def rawlog_of(log):
    return LASER / f"{log}/{log}.rawlog"


@functools.lru_cache(maxsize=3)
def text(log, odometry_seed=0):
    common.need(text_of(log), "set MAPWEAVE_DATA to the folder that holds laser/")
    loaded = carmen.load(text_of(log))
    return carmen.with_odometry(loaded, odometry_seed) if log in CORRECTED_LOGS and odometry_seed else loaded


@functools.lru_cache(maxsize=None)
def span(log):
    stamps = text(log).stamps
    return stamps[0], stamps[-1]


@functools.lru_cache(maxsize=None)
def relations(log):
    if log in BENCHMARK_LOGS:
        return judging.Relations.read(LASER / f"{log}/{log}.relations", BENCHMARK_LOGS[log])
    return judging.Relations(near_scans(text(log).scans))


def near_scans(scans):
    """Relations of a log with true poses: neighbours in time, and scans that come by again near each other and face the same way, at most some
    hundreds in all of each stretch with each other so that no place has all of them."""
    found, step = [], 4
    for i in range(0, len(scans) - step, step):
        found.append((i, i + step))
    again = [(i, j) for i in range(0, len(scans), 2) for j in range(i + 20, len(scans), 2) if is_near(scans[i], scans[j])]
    stretches = {}
    for i, j in again:
        stretches.setdefault((i // 30, j // 30), []).append((i, j))
    for some in stretches.values():
        found += some[::max(1, math.ceil(len(some) / 20))]
    return [(scans[i].stamp, scans[j].stamp, carmen.between(scans[i].robot, scans[j].robot)) for i, j in sorted(found)]


def is_near(a, b):
    return math.dist(a.robot[:2], b.robot[:2]) <= NEAR_M and abs(carmen.wrap(a.robot[2] - b.robot[2])) <= FACING_RAD


@dataclasses.dataclass(frozen=True)
class Cut:
    """`seed` 0: equal parts. `overlap_s`: each part grows by it on either side. `clocks`: the robots' clocks are apart."""
    log: str
    robots: int
    seed: int = 0
    overlap_s: float = 0.0
    clocks: bool = False
    mirrored: bool = False
    name: str = "r"           # of its robots: r0, r1, ...

    def key(self):
        words = [f"{self.robots}", f"random{self.seed}" if self.seed else "equal"]
        words += [f"overlap{self.overlap_s:g}"] if self.overlap_s else []
        words += ["clocks"] if self.clocks else []
        words += ["mirrored"] if self.mirrored else []
        words += [self.name] if self.name != "r" else []
        return "-".join(words)

    def robot_names(self):
        return [f"{self.name}{i}" for i in range(self.robots)]

    def shifts(self):
        """How much later each robot's clock is."""
        return {robot: 86400.0 * (i + 1) + 1234.5 * i if self.clocks else 0.0 for i, robot in enumerate(self.robot_names())}

    def times(self):
        """Where to cut, strictly within the log; none for equal parts."""
        if not self.seed:
            return []
        first, last = span(self.log)
        draw = random.Random(f"{self.log} {self.robots} {self.seed}")
        least = LEAST_PART / self.robots
        while True:
            points = sorted(draw.random() for _ in range(self.robots - 1))
            # Parts of at least `least`, the rest as the points say.
            times = [round(first + (last - first) * (least * (i + 1) + (1 - least * self.robots) * point), 3) for i, point in enumerate(points)]
            # Logs have pauses: a part between two of them would be empty.
            edges = [bisect.bisect_left(text(self.log).stamps, at) for at in (first, *times, last + 1.0)]
            if min(end - begin for begin, end in zip(edges, edges[1:])) >= FEWEST_SCANS:
                return times

    def needs_text(self):
        return self.clocks or self.mirrored or self.log not in BENCHMARK_LOGS

    def write_parts(self, program, folder):
        """Logs of its robots, in their order."""
        if not self.needs_text():
            flags = [flag for at in self.times() for flag in ("--at", repr(at))]
            program("split", rawlog_of(self.log), "--robots", self.robots, "--overlap", self.overlap_s, *flags, "--out", folder, "--force")
            return [folder / f"robot{i}.rawlog" for i in range(self.robots)]
        folder.mkdir(parents=True, exist_ok=True)
        whole = text(self.log, 1 if self.log in CORRECTED_LOGS else 0)
        first, last = span(self.log)
        edges = [first, *(self.times() or [first + (last - first) * i / self.robots for i in range(1, self.robots)]), last + 1.0]
        paths = []
        for i, robot in enumerate(self.robot_names()):
            part = carmen.cut(whole, edges[i] - (self.overlap_s if i else 0.0), edges[i + 1] + (self.overlap_s if i + 1 < self.robots else 0.0))
            part = carmen.shifted(carmen.mirrored(part) if self.mirrored else part, self.shifts()[robot])
            paths.append(part.write(folder / f"{robot}.log.gz"))
        return paths
