"""Teams cut from public logs for programs of their own, and what their results have in common with those of `run`."""
import json
import math
import os

from benches import common
from benches.serve_bench import deployment as live
from benches.team_bench import carmen

INSERT_M, INSERT_RAD = 0.05, 0.026     # laser.graph.insert_distance_m and insert_yaw_rad: other scans show nothing new, and previews leave them out


class Team:
    """Robots of a log on two edges, neighbours on the same one."""

    def __init__(self, log, count, seconds):
        self.name, self.folder = f"{log} as {count} robots", common.OUT / "serve" / f"{log}-{count}-{seconds:g}"
        self.folder.mkdir(parents=True, exist_ok=True)
        whole = carmen.load(common.need(common.DATA / "laser" / log / f"{log}.clf.gz", "set MAPWEAVE_DATA"))
        begin, end = whole.stamps[0], whole.stamps[-1]
        step = min(2 / 3 * seconds, max(0.0, end - begin - seconds) / max(1, count - 1))
        self.cuts = {f"r{i:02}": carmen.cut(whole, begin + i * step, begin + i * step + seconds) for i in range(count)}
        self.edges = {robot: ("north" if i < (count + 1) // 2 else "south") for i, robot in enumerate(self.cuts)}
        for robot, cut in self.cuts.items():
            cut.write(self.folder / f"{robot}.clf.gz")
        self.configuration = write_configuration(self.folder, {robot: f"{robot}.clf.gz" for robot in self.cuts}, self.edges)
        self.seconds = max(cut.stamps[-1] - cut.stamps[0] for cut in self.cuts.values())

    def deployment(self, watch_s=0.25, wire=None, **options):
        return live.Deployment(self.folder, self.configuration, self.edges, options, watch_s, wire)

    def coordinated(self, coordinator, **options):
        """A deployment whose coordinator may give robots to other edges."""
        configuration = self.folder / "coordinated.yaml"
        names = ", ".join(f"{{id: {name}}}" for name in sorted(set(self.edges.values())))
        configuration.write_text(self.configuration.read_text() + f"edges: [{names}]\ncoordinator: {json.dumps(coordinator)}\n")
        return live.Deployment(self.folder, configuration, self.edges, options, has_coordinator=True)

    def outputs_with(self, edges):
        """Of a run whose robots have these edges from the beginning."""
        configuration = write_configuration(self.folder, {robot: f"{robot}.clf.gz" for robot in self.cuts}, edges, name="as_planned.yaml")
        common.mapweave("run", configuration, "--out", self.folder / "as_planned", "--force")
        return outputs(self.folder / "as_planned")

    @staticmethod
    def trajectory(maps, robot):
        return maps / "robots" / robot / "trajectory.tum"

    def outputs_of_run(self):
        folder = self.folder / "run"
        if not folder.exists() or folder.stat().st_mtime < common.PROGRAM.stat().st_mtime:   # of another program
            common.mapweave("run", self.configuration, "--out", folder, "--force")
        return outputs(folder)


def write_configuration(folder, logs, edges, sensor="laser", output="{report: false}", name="run.yaml"):
    path = folder / name
    lines = [f"  - {{id: {robot}, log: {json.dumps(str(folder / log))}, edge: {edges[robot]}}}\n" for robot, log in logs.items()]
    path.write_text(f"sensor: {sensor}\noutput: {output}\nrobots:\n" + "".join(lines))
    return path


def outputs(folder):
    """Checksums of all results but the configuration, which says how programs talk."""
    return {name: one for name, one in json.loads((folder / "manifest.json").read_text())["outputs"].items() if name != "config.yaml"}


def other_than(maps, team):
    """What is not as `run` leaves it."""
    return different(outputs(maps), team.outputs_of_run())


def different(one, other):
    return sorted(name for name in one.keys() | other.keys() if one.get(name) != other.get(name))


def load_average():
    return f"{os.getloadavg()[0]:.1f}"


def scans_of(maps):
    return {robot["id"]: robot["scans"] for robot in json.loads((maps / "summary.json").read_text())["robots"]}


def missing_scans(maps, team):
    scans = scans_of(maps)
    return sum(abs(len(cut.scans) - scans.get(robot, 0)) for robot, cut in team.cuts.items())


def stamps_that_show(trajectory):
    """Stamps of scans that are drawn: the robot has moved since the one before."""
    stamps, last = [], None
    for line in trajectory.read_text().splitlines():
        if line.startswith("#"):
            continue
        stamp, x, y, _, _, _, z, w = map(float, line.split())
        yaw = 2 * math.atan2(z, w)
        if last is None or math.hypot(x - last[0], y - last[1]) > INSERT_M or abs(carmen.wrap(yaw - last[2])) > INSERT_RAD:
            stamps.append(stamp)
            last = x, y, yaw
    return stamps
