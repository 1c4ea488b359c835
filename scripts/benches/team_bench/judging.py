"""Are robots that were joined where hand-checked relations say? Right: the mean error of the relations between two robots is at most three times
the larger of their own, and 5 cm. Wrong otherwise; apart where they are not in one map."""
import bisect
import collections
import math

from benches.team_bench.carmen import between, compose, wrap

SAME_SCAN_S = 0.06
FEWEST = 5        # relations that judge a pair
WELL_RELATED = 20    # relations from which a pair ought to be found


class Relations:
    """(stamp, stamp, (x, y, yaw)) of pairs of scans; `sensor_m`: how far ahead of the robot stands what they speak of."""

    def __init__(self, relations, sensor_m=0.0):
        self.all, self.sensor = relations, (sensor_m, 0.0, 0.0)

    @staticmethod
    def read(path, sensor_m=0.0):
        rows = [line.split() for line in path.read_text().splitlines() if line and line[0] != "#"]
        return Relations([(float(row[0]), float(row[1]), (float(row[2]), float(row[3]), float(row[7]))) for row in rows if len(row) >= 8], sensor_m)


class Trajectory:
    def __init__(self, stamps, poses):
        self.stamps, self.poses = stamps, poses

    @staticmethod
    def read(path, shift_s=0.0):
        """Of a TUM file; `shift_s`: how much later its robot's clock is than the relations'."""
        stamps, poses = [], []
        for line in path.read_text().splitlines():
            if line and line[0] != "#":
                t, x, y, _, qx, qy, qz, qw = (float(value) for value in line.split())
                stamps.append(t - shift_s)
                poses.append((x, y, math.atan2(2 * (qw * qz + qx * qy), 1 - 2 * (qy * qy + qz * qz))))
        return Trajectory(stamps, poses)

    def at(self, stamp):
        """The pose of the scan of that instant; None where there is none."""
        i = bisect.bisect_left(self.stamps, stamp)
        near = min((j for j in (i - 1, i) if 0 <= j < len(self.stamps)), key=lambda j: abs(self.stamps[j] - stamp), default=None)
        return self.poses[near] if near is not None and abs(self.stamps[near] - stamp) < SAME_SCAN_S else None


def team_of(folder, shifts):
    """{robot: (component, trajectory)} of what `merge` or `run` wrote."""
    found = {}
    for number, team in enumerate(sorted(folder.glob("team*/trajectories"))):
        for path in sorted(team.glob("*.tum")):
            found[path.stem] = number, Trajectory.read(path, shifts.get(path.stem, 0.0))
    return found


def errors(relations, team):
    """{(robot, robot): [(metres, radians) or None where they are apart]}, names in order."""
    found = collections.defaultdict(list)
    for t_a, t_b, expected in relations.all:
        ends = [[(robot, component, pose) for robot, (component, trajectory) in team.items() if (pose := trajectory.at(t)) is not None] for t in (t_a, t_b)]
        for robot_a, component_a, pose_a in ends[0]:
            for robot_b, component_b, pose_b in ends[1]:
                off = None
                if component_a == component_b:
                    x, y, yaw = between(expected, between(compose(pose_a, relations.sensor), compose(pose_b, relations.sensor)))
                    off = math.hypot(x, y), abs(wrap(yaw))
                found[tuple(sorted((robot_a, robot_b)))].append(off)
    return dict(found)


def mean(values):
    values = list(values)
    return sum(values) / len(values) if values else None


def pairs(found):
    """Verdicts on pairs that share enough relations: [{a, b, relations, verdict, error_m, error_deg}]."""
    own = {a: mean(off[0] for off in some if off) for (a, b), some in found.items() if a == b}
    rows = []
    for (a, b), some in sorted(found.items()):
        if a == b or len(some) < FEWEST:
            continue
        row = {"a": a, "b": b, "relations": len(some), "verdict": "apart"}
        if None not in some:
            limit = 3 * max(own[a], own[b]) + 0.05 if own.get(a) is not None and own.get(b) is not None else 3 * 0.1 + 0.05
            row["error_m"] = mean(off[0] for off in some)
            row["error_deg"] = math.degrees(mean(off[1] for off in some))
            row["limit_m"] = limit
            row["verdict"] = "right" if row["error_m"] <= limit else "wrong"
        rows.append(row)
    return rows


def totals(found):
    """Sums over the relations within robots and across, so that rows can be added up."""
    within = [off for (a, b), some in found.items() if a == b for off in some if off]
    across = [off for (a, b), some in found.items() if a != b for off in some]
    joined = [off for off in across if off]
    return {"within": len(within), "within_sum_m": sum(off[0] for off in within), "across": len(across), "across_joined": len(joined),
            "across_sum_m": sum(off[0] for off in joined)}
