"""Runs that workers do, and cameras as programs of a deployment."""
import json
import re
import shutil
import signal
import time

from benches import common
from benches.serve_bench import deployment as live
from benches.serve_bench.team import Team, load_average, other_than, write_configuration

WORKERS = 3


class Cameras:
    """A public sequence as robots with a depth camera each, on an edge each."""

    def __init__(self, sequence, count, overlap_s):
        self.name, self.folder = f"{sequence} as {count} cameras", common.OUT / "serve" / f"{sequence}-{count}"
        common.mapweave("split", common.need(common.DATA / "visual" / sequence, "set MAPWEAVE_DATA"), "--robots", count, "--overlap", overlap_s, "--out", self.folder / "logs", "--force")
        logs = {f"robot{i}": f"logs/robot{i}" for i in range(count)}
        self.edges = dict(zip(logs, ("north", "south")))
        self.configuration = write_configuration(self.folder, logs, self.edges, "rgbd", "{report: false, ply: true, octomap: true}")
        self.seconds = max(json.loads(common.mapweave("inspect", self.folder / log, "--json")[1])["duration_s"] for log in logs.values())

    deployment, outputs_of_run = Team.deployment, Team.outputs_of_run


def spread(team):
    """A run that workers do."""
    folder, port = team.folder / "spread", live.free_port()
    folder.mkdir(parents=True, exist_ok=True)
    broker = live.Process("broker", [live.BROKER, "-js", "-a", "127.0.0.1", "-p", port, "-sd", folder / "streams"], folder)
    workers = [live.Process(f"w{i}", [common.PROGRAM, "worker", "--cluster", f"nats://127.0.0.1:{port}", "--name", f"w{i}"], folder) for i in range(WORKERS)]
    broker.start()
    try:
        time.sleep(1.0)
        for worker in workers:
            (folder / f"{worker.name}.log").unlink(missing_ok=True)
            worker.start()
        begin = time.time()
        common.mapweave("run", team.configuration, "--cluster", f"nats://127.0.0.1:{port}", "--out", folder / "maps", "--force")
        took_s = time.time() - begin
        for worker in workers:
            worker.send(signal.SIGTERM)
            worker.process.wait()
    finally:
        for process in (*workers, broker):
            process.kill()
        shutil.rmtree(folder / "streams", ignore_errors=True)
    said = "".join((folder / f"{worker.name}.log").read_text() for worker in workers)
    counts = {what: sum(map(int, re.findall(rf"(\d+) {what}", said))) for what in ("robots mapped", "tasks judged", "dense maps made")}
    return folder / "maps", took_s, counts


def cluster(arguments, seconds):
    for team in (Team("intel", 3, seconds), Cameras("tum_fr1_rpy", 2, 2.3)):
        before, begin = load_average(), time.time()
        shutil.rmtree(team.folder / "run", ignore_errors=True)
        team.outputs_of_run()
        alone_s = time.time() - begin
        maps, took_s, counts = spread(team)
        others = other_than(maps, team)
        goals = ([f"{len(others)} files differ: {', '.join(others[:3])}"] if others else []) + [f"no {what}" for what, count in counts.items() if not count and (what != "dense maps made" or isinstance(team, Cameras))]
        yield {"team": team.name, "how": f"`run --cluster`, {WORKERS} workers: " + ", ".join(f"{count} {what}" for what, count in counts.items()), "alone_s": alone_s, "took_s": took_s, "files": len(team.outputs_of_run()),
               "different": len(others), "load": f"{before}, {load_average()}", "missed": goals}
    before = load_average()
    with team.deployment(speed=1.0) as deployment:
        deployment.wait_for_drives(5 * team.seconds + 120)
        maps = deployment.wait_for_results(180)
        took_s = time.time() - deployment.began
    others = other_than(maps, team)
    yield {"team": team.name, "how": "a deployment, at sensor speed", "alone_s": alone_s, "took_s": took_s, "files": len(team.outputs_of_run()), "different": len(others), "load": f"{before}, {load_average()}",
           "missed": [f"{len(others)} files differ: {', '.join(others[:3])}"] if others else []}


def cluster_cells(row):
    return row["team"], row["how"], f"{row['alone_s']:.1f} s", f"{row['took_s']:.1f} s", row["files"], row["different"]
