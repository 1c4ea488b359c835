"""CARMEN's text logs: cut, mirrored, with other clocks, other frames and odometry of our own. What is written here the program reads."""
import bisect
import gzip
import math
import random


def compose(a, b):
    c, s = math.cos(a[2]), math.sin(a[2])
    return a[0] + c * b[0] - s * b[1], a[1] + s * b[0] + c * b[1], wrap(a[2] + b[2])


def inverse(a):
    c, s = math.cos(a[2]), math.sin(a[2])
    return -c * a[0] - s * a[1], s * a[0] - c * a[1], -a[2]


def between(a, b):
    return compose(inverse(a), b)


def wrap(angle):
    return math.atan2(math.sin(angle), math.cos(angle))


class Scan:
    """One laser line: `head` (new style: type, fan, ...), `packed` ranges (one text, for a log has millions), poses of laser and robot, `tail`
    (new style: speeds), stamp."""
    __slots__ = ("keyword", "head", "packed", "laser", "robot", "tail", "stamp")

    def __init__(self, keyword, head, packed, laser, robot, tail, stamp):
        self.keyword, self.head, self.packed, self.laser, self.robot, self.tail, self.stamp = keyword, head, packed, laser, robot, tail, stamp

    @property
    def ranges(self):
        return self.packed.split()

    def text(self):
        poses = " ".join(f"{value:.6f}" for value in (*self.laser, *self.robot))
        new_style = self.head is not None
        front = f"{self.keyword} {' '.join(self.head)} " if new_style else f"{self.keyword} "
        between_them = " 0 " if new_style else " "   # no remissions
        tail = f" {' '.join(self.tail)}" if new_style else ""
        return f"{front}{self.packed.count(' ') + 1} {self.packed}{between_them}{poses}{tail} {self.stamp:.6f} robot {self.stamp:.6f}\n"

    def at(self, laser, robot, stamp=None):
        return Scan(self.keyword, self.head, self.packed, laser, robot, self.tail, self.stamp if stamp is None else stamp)


class Log:
    def __init__(self, scans, parameters):
        self.scans, self.parameters = scans, parameters
        self.stamps = [scan.stamp for scan in scans]

    def write(self, path):
        with gzip.open(path, "wt", compresslevel=1) as out:
            out.write("# CARMEN log\n")
            out.writelines(self.parameters)
            out.writelines(scan.text() for scan in self.scans)
        return path


def parse(line):
    fields = line.split()
    keyword, head, start = fields[0], None, 1
    if keyword.startswith("ROBOTLASER"):
        head, start = fields[1:8], 8
    count = int(fields[start])
    ranges, rest = fields[start + 1:start + 1 + count], fields[start + 1 + count:]
    tail = None
    if head is not None:
        rest = rest[1 + int(rest[0]):]
        tail, rest = rest[6:11], rest[:6] + rest[11:]
    values = [float(value) for value in rest[:6]]
    return Scan(keyword, head, " ".join(ranges), tuple(values[:3]), tuple(values[3:]), tail, float(rest[6]))


def load(path):
    """Laser lines, which bring the odometry of their instant; ODOM lines are left out, as the program does."""
    scans, parameters = [], []
    with gzip.open(path, "rt") if path.suffix == ".gz" else open(path) as lines:
        for line in lines:
            if line.startswith(("FLASER", "ROBOTLASER1 ")):
                scans.append(parse(line))
            elif line.startswith("PARAM"):
                parameters.append(line)
    scans.sort(key=lambda scan: scan.stamp)
    return Log(scans, parameters)


def cut(log, first_s, end_s):
    """Scans of [first, end), the odometry restarted at the origin."""
    scans = log.scans[bisect.bisect_left(log.stamps, first_s):bisect.bisect_left(log.stamps, end_s)]
    if not scans:
        return Log([], log.parameters)
    back = inverse(scans[0].robot)
    return Log([scan.at(compose(back, scan.laser), compose(back, scan.robot)) for scan in scans], log.parameters)


def shifted(log, seconds):
    return Log([scan.at(scan.laser, scan.robot, scan.stamp + seconds) for scan in log.scans], log.parameters)


def mirrored(log):
    """The building seen in a mirror: left is right. An even number of old-style rays starts at -90 degrees and ends a step before +90, so that
    the mirror image has a ray more, whose first saw nothing."""
    nothing = max((max(scan.ranges, key=float) for scan in log.scans), key=float)

    def mirror(scan):
        ranges = scan.ranges[::-1]
        if scan.head is None and len(ranges) % 2 == 0:
            ranges = [nothing, *ranges]
        head = scan.head
        if head is not None:   # the fan from the other side
            head = [head[0], f"{-(float(head[1]) + float(head[3]) * (len(ranges) - 1)):.8f}", *head[2:]]
        turned = [(x, -y, -yaw) for x, y, yaw in (scan.laser, scan.robot)]
        return Scan(scan.keyword, head, " ".join(ranges), *turned, scan.tail, scan.stamp)
    return Log([mirror(scan) for scan in log.scans], log.parameters)


def with_odometry(log, seed, noise_m=0.02, turn_noise=0.02, scale=0.02, turn_scale=0.02, drift_deg_per_m=0.1):
    """The log's poses falsified as wheels do: noise that grows with the root of the path, and constant errors of scale, of turns and of heading."""
    draw = random.Random(seed)
    scale, turn_scale = 1.0 + draw.gauss(0.0, scale), 1.0 + draw.gauss(0.0, turn_scale)
    drift = math.radians(draw.gauss(0.0, drift_deg_per_m))
    scans, pose = [], (0.0, 0.0, 0.0)
    for before, scan in zip([log.scans[0], *log.scans], log.scans):
        x, y, turn = between(before.robot, scan.robot)
        path_m = math.hypot(x, y)
        pose = compose(pose, (scale * x + draw.gauss(0.0, noise_m * math.sqrt(path_m)), scale * y + draw.gauss(0.0, noise_m * math.sqrt(path_m)),
                              turn_scale * turn + drift * path_m + draw.gauss(0.0, turn_noise * math.sqrt(abs(turn)) + 0.005 * math.sqrt(path_m))))
        scans.append(scan.at(compose(pose, between(scan.robot, scan.laser)), pose))
    return Log(scans, log.parameters)
